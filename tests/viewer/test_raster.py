"""Pictures against what geometry says of them, in a browser without a graphics card."""

import numpy as np
import pytest
from export.pages import browser

from cfem import viewer

SCRIPT = viewer.script("window.drawn = { makeRaster, makeSheet, fill, framed, axesOf, tubeSheet, normalsOf, TONES };")
# Sheets whose points are already pixels, each of one tone; filled into a raster of 60 x 40 pixels that begins at 5, 3.
FILLED = """({ points, triangles, mode, flipped, under }) => { const d = window.drawn, raster = d.makeRaster();
  raster.clear(5, 3, 60, 40);
  const table = new Uint32Array(d.TONES * d.TONES);
  for (const [k, [at, order]] of (under ?? []).concat([[points, triangles]]).entries()) {
    const unused = new Float32Array(at.length), sheet = d.makeSheet(Uint32Array.from(order), unused, unused, flipped);
    sheet.at.set(at);
    d.fill(raster, sheet, table.fill(0x40000001 + k), mode);
  }
  const known = Array.from(raster.depth.subarray(0, 2400), value => Number.isFinite(value) ? value : null);
  return [Array.from(raster.colour.subarray(0, 2400)), known]; }"""


@pytest.fixture(scope="module")
def tab():
    with browser() as chromium:
        one = chromium.new_page()
        one.add_script_tag(content=SCRIPT)
        yield one


def filled(tab, points, triangles, **more):
    given = {"points": np.ravel(points).tolist(), "triangles": np.ravel(triangles).tolist(), "mode": 0, **more}
    colour, depth = tab.evaluate(FILLED, given)
    return np.array(colour).reshape(40, 60), np.array(depth, float).reshape(40, 60)


def inside(corners, shape=(40, 60), left=5, top=3):
    """Whether pixel centres lie in a triangle."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    p = np.stack([x + left, y + top], axis=-1)
    a, b, c = (np.asarray(one[:2]) for one in corners)
    signs = [(v - u)[0] * (p - u)[..., 1] - (v - u)[1] * (p - u)[..., 0] for u, v in ((a, b), (b, c), (c, a))]
    return (np.array(signs) < 0).all(axis=0) | (np.array(signs) > 0).all(axis=0)


FRONT = [[10.2, 30.7, 1.0], [50.9, 35.1, 2.0], [22.3, 8.4, 5.0]]  # against the clock, y down


def test_a_front_covers_the_pixels_whose_centres_it_holds_at_their_depth(tab):
    colour, depth = filled(tab, FRONT, [0, 1, 2])
    expected = inside(FRONT)
    assert (colour > 0).tolist() == expected.tolist() and expected.sum() > 300
    y, x = np.nonzero(expected)
    plane = np.linalg.solve(np.c_[np.array(FRONT)[:, :2], np.ones(3)], np.array(FRONT)[:, 2])
    np.testing.assert_allclose(depth[expected], np.c_[x + 5.5, y + 3.5, np.ones(len(x))] @ plane, atol=1e-5)


def test_a_back_is_not_drawn_unless_it_is_the_front(tab):
    assert not filled(tab, FRONT, [0, 2, 1])[0].any()
    assert (filled(tab, FRONT, [0, 2, 1], flipped=True)[0] > 0).tolist() == inside(FRONT).tolist()


def test_what_leaves_the_raster_is_cut(tab):
    far = [[-300.0, 20.0, 0.0], [400.0, 900.0, 0.0], [200.0, -700.0, 0.0]]
    assert (filled(tab, far, [0, 1, 2])[0] > 0).tolist() == inside(far).tolist()


def test_triangles_that_share_edges_cover_each_pixel_once(tab):
    """Pale ones would be darker where two meet."""
    x, y = np.meshgrid(np.linspace(4.0, 66.0, 8), np.linspace(2.0, 44.0, 6))
    shift = np.random.default_rng(1).uniform(-2, 2, (2, *x.shape))
    points = np.stack([x + shift[0], y + shift[1], 0 * x], axis=-1).reshape(-1, 3)
    i, j = (one.ravel() for one in np.meshgrid(np.arange(5), np.arange(7), indexing="ij"))
    a, b, c, d = 8 * i + j, 8 * i + j + 1, 8 * i + j + 8, 8 * i + j + 9
    triangles = np.concatenate([np.c_[a, c, b], np.c_[b, c, d]])
    colour = filled(tab, points, triangles, mode=1)[0]
    middle = colour[5:-5, 5:-5]
    assert len(np.unique(middle)) == 1 and middle[0, 0] >> 24 == 0x40


def test_the_nearer_hides_the_farther_whichever_comes_first(tab):
    near = [[p[0], p[1], 9.0] for p in FRONT]
    order = [0, 1, 2]
    flat = np.ravel
    one, _ = filled(tab, near, order, under=[[flat(FRONT).tolist(), order]])
    other, depth = filled(tab, FRONT, order, under=[[flat(near).tolist(), order]])
    assert set(np.unique(one)) == {0, 0x40000002} and set(np.unique(other)) == {0, 0x40000001}
    assert np.nanmin(depth) == np.nanmax(depth) == 9


def test_tubes_and_balls_are_closed_with_their_normals_outward(tab):
    straight = [[0, 0, 0], [0, 0, 4], [0, 0, 10]]
    for points, radius, expected in (
        (straight, 2.0, 10 * 12 * np.sin(np.pi / 6) / 2 * 4),
        ([[1, 2, 3]], 3.0, 36 * np.pi),
    ):
        triangles, place, normal = tab.evaluate(
            "([points, radius]) => { const s = window.drawn.tubeSheet(points, radius); "
            "return [[...s.triangles], [...s.place], [...s.normal]]; }",
            [points, radius],
        )
        triangles, place, normal = (np.array(one).reshape(-1, 3) for one in (triangles, place, normal))
        corners = place[triangles]
        volume = np.linalg.det(corners).sum() / 6
        assert volume == pytest.approx(expected, rel=1e-6 if len(points) > 1 else 0.1)
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        wide = np.linalg.norm(sides, axis=1) > 1e-6
        assert ((sides * normal[triangles].mean(axis=1)).sum(axis=1)[wide] > 0).all()
        np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=0.02)


def test_normals_of_a_sphere_point_away_from_its_middle(tab):
    place, normal = tab.evaluate(
        "() => { const { place, triangles } = window.drawn.tubeSheet([[0, 0, 0]], 5); "
        "return [[...place], [...window.drawn.normalsOf(place, triangles, new Float32Array(place.length))]]; }"
    )
    place, normal = (np.array(one).reshape(-1, 3) for one in (place, normal))
    away = place / np.linalg.norm(place, axis=1)[:, None]
    around = np.abs(away[:, 2]) < 0.95
    assert ((normal * away).sum(axis=1)[around] > 0.95).all()


def test_a_camera_frames_all_places(tab):
    rng = np.random.default_rng(2)
    places = rng.normal(size=(200, 3)) * [30, 5, 80] + [7, -40, 300]
    margin = {"top": 60, "bottom": 80, "side": 30}
    camera, axes = tab.evaluate(
        "([places, margin]) => { const camera = window.drawn.framed(places, 33, 14, 800, 600, margin); "
        "return [camera, window.drawn.axesOf(camera)]; }",
        [places.ravel().tolist(), margin],
    )
    across = (places - camera["centre"]) @ np.array([axes["right"], axes["up"]]).T
    pixels = across * 600 / camera["height"] * [1, -1] + [400, 300]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    assert (low >= [30 - 1e-6, 60 - 1e-6]).all() and (high <= [770 + 1e-6, 520 + 1e-6]).all()
    assert np.isclose(low[1], 60) or np.isclose(low[0], 30)
