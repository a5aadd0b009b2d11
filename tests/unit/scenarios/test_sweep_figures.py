"""Figures of a sweep can be read."""

from itertools import pairwise

from matplotlib.figure import Figure

from terrain.sweeps.figures import write_figures


def test_numbers_at_the_axes_of_box_plots_stand_clear_of_each_other(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    rows = [
        {"variant": "a", "success": True, "spl": 0.9725 + 0.0125 * seed, "path_over_geodesic": 1.015 + 0.015 * seed}
        | {"seed": seed, "time_s": 38.1 + 1.2 * seed, "path_length_m": 28.2 + 0.6 * seed}
        for seed in (0, 1)
    ]
    write_figures(rows, tmp_path)
    drawn[0].draw_without_rendering()
    assert len(drawn[0].axes) == 4
    for panel in drawn[0].axes:
        boxes = [label.get_window_extent() for label in panel.get_xticklabels() if label.get_text()]
        shown = [box for box in boxes if panel.bbox.x0 <= 0.5 * (box.x0 + box.x1) <= panel.bbox.x1]
        assert len(shown) >= 2 and all(one.x1 < other.x0 for one, other in pairwise(shown)), panel.get_xlabel()
