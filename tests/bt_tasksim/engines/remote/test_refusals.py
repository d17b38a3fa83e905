"""The log of refusals: all at first, few in a flood, and none forgotten."""

from bt_tasksim.engines.remote.refusals import RefusalLog


def test_a_flood_is_counted_and_not_shown():
    now, said = [0.0], []
    log = RefusalLog(said.append, burst=3, rate=2.0, clock=lambda: now[0])
    for k in range(1000):
        log(f"message {k}")
    assert said == ["refused: message 0", "refused: message 1", "refused: message 2"]
    now[0] += 0.5
    log("later")
    log("too soon")
    assert said[3:] == ["refused: later (before it 997 more, not shown)"]
    now[0] += 100.0
    for k in range(10):
        log(str(k))
    assert said[4:] == ["refused: 0 (before it 1 more, not shown)", "refused: 1", "refused: 2"]
