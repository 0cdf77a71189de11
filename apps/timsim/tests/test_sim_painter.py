"""A painter: pictures of a motion that is not over yet."""

import numpy as np
import pytest

from timsim import Painter, still


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_the_body_stays_in_the_picture(hop, renderer):
    """Wherever it goes, and however far: its pixels never touch the sides."""
    leg = hop.model
    leg.geom_rgba[1:] = (0.0, 0.9, 0.0, 1)  # all but the ground: green
    painter = Painter(leg, width=320, height=240, renderer=renderer)
    assert painter.renderer == renderer
    assert bool(painter.note) == (renderer == "drawn")
    for distance in np.linspace(0, 30, 16):
        position = hop.position[0] + [distance, 0.02 * distance, 0, 0]
        picture = painter.paint(position, hop.activation[0]).astype(int)
        assert picture.shape == (240, 320, 3)
        green = picture[..., 1] - picture[..., [0, 2]].max(-1) > 40
        rows, columns = np.flatnonzero(green.any(1)), np.flatnonzero(green.any(0))
        assert green.sum() > 300
        assert rows[0] > 20
        assert rows[-1] < 236
        assert columns[0] > 3
        assert columns[-1] < 316
    painter.close()


@pytest.mark.ci
@pytest.mark.representatives("drawn")
def test_a_small_motion_keeps_its_view(hop, renderer):
    """What stands still in the world stands still in the pictures; the body moves."""
    painter = Painter(hop.model, width=160, height=120, renderer=renderer)
    painter.paint(hop.position[0], hop.activation[0])
    view = painter._view
    one = painter.paint(hop.position[0] + [0, 0, 0.02, -0.02], hop.activation[0])
    other = painter.paint(hop.position[0] + [0, 0, 0.02, -0.02], hop.activation[0], "left", "right")
    assert painter._view is view
    assert (one[40:] == other[40:]).all()
    assert (one[:30] != other[:30]).any()
    painter.close()


def test_it_paints_as_a_still_does(hop, renderer):
    """The same renderer behind both: a still of a motion as large as the painter's view, pixel for pixel."""
    painter = Painter(hop.model, width=160, height=120, renderer=renderer, camera="side" if hop.model.ncam else None)
    found = painter.paint(hop.position[0], hop.activation[0], hop.label, "0.00 s")
    wanted = still(hop, 0, width=160, height=120, renderer=renderer)
    # framed differently, coloured alike
    assert abs(found.mean() - wanted.mean()) < 12
    painter.close()


def test_closing_is_final(hop):
    painter = Painter(hop.model, width=64, height=64, renderer="drawn")
    painter.close()
    painter.close()
    with pytest.raises(RuntimeError, match="closed"):
        painter.paint(hop.position[0], hop.activation[0])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"width": 63}, "width = 63"),
        ({"renderer": "drwan"}, "did you mean 'drawn'"),
        ({"camera": "nowhere"}, "unknown camera 'nowhere'"),
        ({"camera": np.inf}, "camera = inf"),
    ],
)
def test_bad_settings_are_refused(hop, settings, message):
    with pytest.raises(ValueError, match=message):
        Painter(hop.model, **settings)


def test_a_posture_of_another_shape_is_refused(hop):
    painter = Painter(hop.model, renderer="drawn")
    with pytest.raises(ValueError, match=r"position.shape = \(3,\): must be \(4,\)"):
        painter.paint(np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match=r"activation.shape = \(1,\): must be \(4,\)"):
        painter.paint(np.zeros(4), np.zeros(1))
