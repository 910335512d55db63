"""The animation of a report as a GIF, frame by frame in headless Chromium.

moving_picture.py REPORT_HTML OUT_GIF [FRAMES]"""

import io
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

SIZE = (400, 400)  # pixels
# Only the first animation stays on the page, stopped at a share of its way.
SCRIPT = """
<script>addEventListener("load", () => {
  const figure = document.querySelector("figure.viewer"), slide = figure.querySelector("input[type=range]");
  document.body.replaceChildren(figure); document.body.style = "margin:0;padding:0;background:#fff";
  figure.style = "margin:0;padding:0;width:%dpx";
  for (const each of figure.querySelectorAll(".controls, .legend, figcaption")) each.style.display = "none";
  setTimeout(() => { slide.value = %f * slide.max; slide.dispatchEvent(new Event("input")); }, 300);
});</script>"""


def frame(page: str, share: float) -> Image.Image:
    with tempfile.TemporaryDirectory() as folder:
        html, png = Path(folder) / "page.html", Path(folder) / "page.png"
        html.write_text(page + SCRIPT % (SIZE[0], share))
        words = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"]
        words += ["--disable-background-networking", f"--user-data-dir={folder}/profile", "--virtual-time-budget=1500"]
        words += [f"--window-size={SIZE[0]},{SIZE[1]}", f"--screenshot={png}", html.as_uri()]
        subprocess.run(words, check=True, capture_output=True)
        return Image.open(io.BytesIO(png.read_bytes())).convert("RGB")


def main(report: Path, out: Path, count: int = 36) -> None:
    frames = [frame(report.read_text(), i / count) for i in range(count)]
    colours = frames[0].quantize(64, dither=Image.Dither.NONE)
    small = [one.quantize(palette=colours, dither=Image.Dither.NONE) for one in frames]
    small[0].save(out, save_all=True, append_images=small[1:], duration=110, loop=0, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:]))
