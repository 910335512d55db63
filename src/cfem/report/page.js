// A table that is wider than the screen says that it goes on to the right.
for (const box of document.querySelectorAll(".scroll")) {
  const hint = document.createElement("small"), look = () => box.classList.toggle("more", box.scrollWidth - box.clientWidth - box.scrollLeft > 2);
  hint.className = "hint"; hint.textContent = "The table goes on: scroll it sideways →"; hint.setAttribute("aria-hidden", "true");
  box.after(hint);
  box.addEventListener("scroll", look);
  new ResizeObserver(look).observe(box);
}
// A link of the table of contents opens the part that it leads to.
const open = () => { const part = document.getElementById(location.hash.slice(1)); if (part instanceof HTMLDetailsElement) { part.open = true; part.scrollIntoView(); } };
addEventListener("hashchange", open);
document.querySelectorAll("nav a").forEach(link => link.addEventListener("click", () => setTimeout(open)));
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(part => { part.open = true; }));
open();
