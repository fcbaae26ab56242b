"""Answers: what they say, how they show themselves, and how they are stopped."""

import subprocess
import sys
import time

import numpy as np
import pytest

import hysteron


def test_val_a_comparison_has_figures_series_and_a_page(stage, model, tmp_path):
    comparison = hysteron.compare(stage, model)
    assert comparison.validate["records"] == 3
    assert len(comparison.records) == len(comparison.series) == len(stage)
    series = comparison.series[0]
    error = series["measured"] - series["modelled"]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(comparison.records[0]["rms_um"])
    assert "pooled over 3 validate records" in repr(comparison)
    page = comparison.page()
    assert page._repr_html_().startswith("<iframe srcdoc=") and "<svg" in page.text
    page.save(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.text


def test_val_a_model_says_its_parameters_and_predicts(stage, model):
    names = [p["name"] for p in model.parameters]
    assert names[:2] == ["offset", "linear"] and len(model.thresholds) == 10
    assert "weight[1]" in repr(model) and (model.family, model.direction) == ("mpi", "forward")
    u = 13 - 13 * np.cos(2 * np.pi * 50 * np.arange(2000) / 50e3)
    truth = hysteron.simulate("paper-rate", u, 50e3)[0].y
    assert np.std(model.predict(u, 50e3) - truth) < 0.05 * np.ptp(truth)
    with pytest.raises(hysteron.Error, match=r"u\[1\] = NaN"):
        model.predict([0.0, float("nan")], 50e3)


def test_val_an_effect_is_added_and_the_ladder_shows_it(stage, model):
    with pytest.raises(hysteron.Error, match="nothing was added to this model yet"):
        hysteron.ladder(model)
    better = hysteron.add(stage, model, "first-order-lag")
    assert [effect["name"] for effect in better.effects] == ["first-order-lag"]
    ladder = hysteron.ladder(better)
    first, last = (ladder.steps[end]["validate_percent"] for end in (0, -1))
    assert last < first and "+ first-order-lag" in repr(ladder) and "<svg" in ladder.page().text
    with pytest.raises(hysteron.Error, match="first-order-lag"):
        hysteron.add(stage, model, "first-order-leg")


def test_val_pictures_are_drawn_where_matplotlib_is(stage, model):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    comparison = hysteron.compare(stage, model)
    for figure in (stage.plot(), comparison.plot()):
        assert len(figure.axes) == 2 * len(stage)
        matplotlib.pyplot.close(figure)


def test_val_pages_stand_in_for_pictures(stage, model, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert isinstance(stage.plot(), hysteron.Page)
    assert hysteron.compare(stage, model).plot().text == hysteron.compare(stage, model).page().text


def test_refuse_options_in_words(stage):
    with pytest.raises(hysteron.Error, match="model: unknown variant `ppi`, expected one of `pi`, `mpi`"):
        hysteron.fit(stage, "ppi")
    inverse = hysteron.fit(stage, "mpi", direction="inverse")
    with pytest.raises(hysteron.Error, match="an inverse model has no place for physical effects"):
        hysteron.diagnose(stage, inverse)


STOPPED = """
import _thread, signal, threading, time
import hysteron
# A shell starts what runs in the background deaf to it.
signal.signal(signal.SIGINT, signal.default_int_handler)
stage = hysteron.example("paper-stage", progress=False)
threading.Timer(0.1, lambda: signal.raise_signal(signal.SIGINT)).start()
began = time.monotonic()
try:
    hysteron.learn(stage, progress=False)
except KeyboardInterrupt:
    print(time.monotonic() - began)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a signal of this kind is not raised there")
def test_val_ctrl_c_stops_long_work():
    done = subprocess.run([sys.executable, "-c", STOPPED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    # Learning on these records takes far longer; the work ends where it next says how far it is.
    assert 0.1 <= float(done.stdout) < 15.0


def test_val_other_threads_run_during_work(stage):
    import threading

    ticks, over = [], threading.Event()

    def tick():
        while not over.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    hysteron.fit(stage, "mrpi", plays=20)
    over.set()
    thread.join()
    assert len(ticks) > 3
