"""Animations as GIF files, read back by Pillow frame by frame."""

import io

import numpy as np
from PIL import Image

from cfem.report.gif import LEAST, MOST, SHARP, WIDTH, gif, still
from cfem.report.viewer import Polyline, Take, Viewer

X = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 3], [1, 0, 3], [1, 1, 3], [0, 1, 3]], float) * 10
QUADS = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
BOX = np.array([(a, b, c) for q in QUADS for a, b, c in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))])


def leaning(count, x=X):
    shear = np.linspace(0, 0.6, count)
    shapes = x + shear[:, None, None] * x[:, 2:] * np.array([1.0, 0.3, 0.0])
    tips = shapes[:, 4]
    cable = Polyline("left", "--c1", shapes[:, [0, 4]])
    return Take("lean", shapes, range(count), tips, tips, np.zeros(count), (cable,))


def drawn(take, milliseconds):
    viewer = Viewer("lean", "", BOX, np.zeros(len(BOX), dtype=int), (take,))
    return gif(viewer, take, milliseconds)


def pixels(picture, frame):
    picture.seek(frame)
    return np.asarray(picture.convert("RGB")).astype(int)


def test_every_shape_is_a_frame_that_lasts_as_long_as_it_should():
    picture = Image.open(io.BytesIO(drawn(leaning(4), [100, 50, 200, 80])))
    assert picture.n_frames == 4 and picture.info["loop"] == 0 and picture.width == WIDTH
    lasting = []
    for frame in range(4):
        picture.seek(frame)
        lasting.append(picture.info["duration"])
    assert lasting == [100, 50, 200, 80]


def test_the_body_moves_and_stays_within_the_picture():
    picture = Image.open(io.BytesIO(drawn(leaning(3), [100] * 3)))
    frames = [pixels(picture, frame) for frame in range(3)]
    body = [(one[..., 2] - one[..., 0]) > 40 for one in frames]  # bluer than red
    for one in body:
        assert 0.02 < one.mean() < 0.9
        assert not (one[0].any() or one[-1].any() or one[:, 0].any() or one[:, -1].any())
        assert (frames[0][0, 0] == 255).all()
    assert (body[0] != body[2]).mean() > 0.01


def test_the_same_shapes_give_the_same_bytes():
    assert drawn(leaning(2), [100, 100]) == drawn(leaning(2), [100, 100])


def test_long_and_flat_robots_have_pictures_of_bounded_height():
    for stretch in ((1, 1, 30), (30, 30, 0.1)):
        picture = Image.open(io.BytesIO(drawn(leaning(2, X * stretch), [100, 100])))
        assert LEAST <= picture.height <= MOST


def test_a_still_shows_the_farthest_shape_in_full_and_the_rest_pale():
    take = leaning(5)
    viewer = Viewer("lean", "", BOX, np.zeros(len(BOX), dtype=int), (take,))
    picture = Image.open(io.BytesIO(still(viewer, take, X)))
    assert picture.width == SHARP * WIDTH and picture.format == "PNG"
    last = pixels(Image.open(io.BytesIO(drawn(take, [100] * 5))), 4)
    small = np.asarray(picture.convert("RGB").resize(last.shape[1::-1])).astype(int)
    body = last[..., 2] - last[..., 0] > 60
    assert (
        body.mean() > 0.1 and np.abs(small[body] - last[body]).mean() < 12
    )  # the shape is that of the animation's end
    beside = small[(last.min(axis=2) > 250) & (small.min(axis=2) < 240)]
    assert len(beside) > 0.005 * body.size and (beside[:, 2] >= beside[:, 0]).mean() > 0.8  # pale where it left
