"""Ctrl-C: what was simulated until then is there, whole, and says that it was interrupted."""

import os
import signal
import threading

import pytest
from tests.scenes import OWN, digests, every_step, run, scenario

import fleet2d


def endless(**simulation):
    """A run that would take hours: a step at a time."""
    content = every_step("300 d")
    content["simulation"] |= simulation
    return content


def interrupt_after(seconds):
    timer = threading.Timer(seconds, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    return timer


@pytest.mark.slow
def test_an_interrupted_run_is_whole_until_where_it_stopped(tmp_path):
    simulation = fleet2d.Simulation(endless(), out=tmp_path / "run")
    timer = interrupt_after(0.5)
    with pytest.raises(KeyboardInterrupt):
        simulation.run()
    timer.join()
    stored = fleet2d.open_run(tmp_path / "run")
    assert "interrupted" == stored.status
    steps = stored.manifest["steps"]
    assert 0 < steps == simulation.step
    assert [] == stored.verify()
    assert any("interrupted" in note for note in stored.notes)
    assert digests(run(every_step(f"{steps} s"))) == digests(stored)


def test_a_paced_run_stops_soon():
    simulation = fleet2d.Simulation(
        scenario("1 d", users={"ana": {"type": "meander"}}), speedup=1.0
    )
    timer = interrupt_after(0.3)
    with pytest.raises(KeyboardInterrupt):
        simulation.run()
    timer.join()
    assert simulation.step < 3600


def test_a_second_interrupt_does_not_wait_for_the_span_to_end():
    impatient = {"type": f"{OWN}:Impatient", "period": "1 min"}
    simulation = fleet2d.Simulation(scenario("10 min", algorithms={"impatient": impatient}))
    with pytest.raises(KeyboardInterrupt):
        simulation.run()
    assert ["first", "second"] == simulation._state.learners.all[0].component.lived_to_see


def test_the_handler_of_the_caller_is_put_back():
    before = signal.getsignal(signal.SIGINT)
    run(scenario("1 min", users={"ana": {"type": "meander"}}))
    assert before is signal.getsignal(signal.SIGINT)


def test_a_run_in_another_thread_leaves_signals_alone():
    done = []
    thread = threading.Thread(target=lambda: done.append(run(scenario("1 min")).status))
    thread.start()
    thread.join()
    assert ["complete"] == done
