import matplotlib.pyplot as plt

from kickdyn.view.style import STYLE


def test_matplotlib_knows_every_setting():
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots()
        axes.plot([0, 1], [0, 1])
        figure.canvas.draw()
        assert figure.get_layout_engine() is not None
        assert not axes.spines["top"].get_visible()
    plt.close(figure)
