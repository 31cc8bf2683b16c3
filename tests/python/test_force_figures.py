"""moraine.spheres on spheres whose picture is known; moraine.force_figures draw a small bed without complaint."""
import numpy as np
import pytest

from fake_snapshot import write
from moraine import MissingData, force_figures, spheres

red, blue = np.array([1.0, 0, 0, 1]), np.array([0, 0, 1.0, 1])


def bed(directory, **more):
    """Simple cubic, 5 x 5 x 6, with all contacts, fixed layers below and above, and some motion."""
    k = np.arange(150)
    place = np.column_stack([k % 5, k // 5 % 5, k // 25]) + 0.5
    pairs = [(a, b) for a in k for b in k[a + 1:] if abs(np.linalg.norm(place[a] - place[b]) - 1) < 1e-9]
    role = np.select([k < 25, k >= 125], [1, 2], 0)
    motion = {"velocity": 0.1 * place[:, [2, 0, 1]], "spin": np.sin(place), "pressure": k * 20.0}
    return write(directory, place, 0.5, pairs, 1.0 + np.arange(len(pairs)) % 7, box=(5, 5, 0), top_wall=6, role=role, **motion | more)


def test_the_nearer_sphere_hides_the_farther():
    at = np.array([[0, 0, 0], [0, 3.0, 0]])  # seen along +y
    for order in ([0, 1], [1, 0]):
        image, place = spheres.render(at[order], np.array([1.0, 1.0]), np.array([red, blue])[order], 0, 0, 200)
        column, row = (int(round(float(q))) for q in place(at[0]))
        assert image[row, column, 0] > 2 * image[row, column, 2] and image[row, column, 3] == 1
        assert image[0, 0, 3] == 0  # nothing in the corner


def test_right_and_up_are_x_and_z():
    at = np.array([[-2.0, 0, -2], [2, 0, 2]])
    image, place = spheres.render(at, np.array([1.0, 1.0]), np.array([red, blue]), 0, 0, 300)
    (x0, y0), (x1, y1) = place(at[0]), place(at[1])
    assert x1 > x0 and y1 < y0
    assert image[int(y1), int(x1), 2] > image[int(y1), int(x1), 0]


@pytest.mark.filterwarnings("error")
def test_each_figure_is_drawn(tmp_path):
    s = bed(tmp_path)
    figures = [force_figures.pressure_3d(s, 1e3), force_figures.force_network(s, s), force_figures.stereonets(s, s, 300.0, 1e3),
               force_figures.force_distribution([s, s], ["one", "two"], 1e3), force_figures.section([s, s, s], 1e3)]
    for k, figure in enumerate(figures):
        figure.savefig(tmp_path / f"{k}.png", dpi=40)
        force_figures.plt.close(figure)


def test_a_figure_names_what_is_missing(tmp_path):
    with pytest.raises(MissingData, match="pressure"):
        force_figures.pressure_3d(bed(tmp_path, leave_out=["grains/pressure"]), 1e3)
