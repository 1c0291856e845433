import signal
import sys
import threading
import time
from collections.abc import Generator, Iterator
from contextlib import contextmanager

import pytest

from evimo.streaming.threads import Background, ahead, in_parallel


def counting(made: list[int], *, last: int = 10_000) -> Generator[int, None, None]:
    for number in range(last):
        made.append(number)
        yield number


def test_ahead_gives_the_same_items_in_order():
    assert list(ahead(iter(range(1000)), depth=3)) == list(range(1000))
    assert list(ahead(())) == []


def test_ahead_works_in_another_thread_and_never_far_ahead():
    made: list[int] = []
    items = ahead(counting(made), depth=2)
    assert next(items) == 0
    time.sleep(0.2)
    assert 2 <= len(made) <= 4  # one here, two waiting, one in the maker's hands
    items.close()


def test_a_failure_arrives_after_the_items_before_it():
    def failing() -> Iterator[int]:
        yield from (1, 2)
        raise ValueError("broken")

    seen: list[int] = []
    with pytest.raises(ValueError, match="broken"):
        seen.extend(ahead(failing()))
    assert seen == [1, 2]


def test_closing_ends_the_thread_and_closes_the_items():
    closed = threading.Event()

    def endless() -> Iterator[int]:
        try:
            while True:
                yield 1
        finally:
            closed.set()

    before = threading.active_count()
    outer = ahead(ahead(endless()))
    next(outer)
    outer.close()
    assert closed.wait(5)
    deadline = time.monotonic() + 5
    while threading.active_count() > before and time.monotonic() < deadline:
        time.sleep(0.01)
    assert threading.active_count() == before


def test_parallel_work_keeps_the_order():
    def slow_for_even(number: int) -> int:
        time.sleep(0.01 * (number % 2 == 0))
        return number**2

    items = ahead(range(40))
    assert list(in_parallel(slow_for_even, items, workers=3)) == [number**2 for number in range(40)]


def test_parallel_work_takes_no_more_items_than_it_says():
    made: list[int] = []
    results = in_parallel(str, counting(made), workers=2)
    assert [next(results), next(results)] == ["0", "1"]
    assert len(made) == 4  # two given out, two in work; the next one is taken when the next result is wanted
    results.close()


def test_parallel_work_fails_in_its_place():
    def fail_at_three(number: int) -> int:
        return 1 // (number - 3)

    seen: list[int] = []
    with pytest.raises(ZeroDivisionError):
        seen.extend(in_parallel(fail_at_three, counting([]), workers=2))
    assert len(seen) == 3


def test_closing_parallel_work_closes_the_items():
    items = counting([])
    results = in_parallel(str, items, workers=2)
    next(results)
    results.close()
    assert not list(items)


def test_background_does_all_in_order_before_it_closes():
    done: list[int] = []
    worker = Background(done.append, depth=2)
    for number in range(100):
        worker.put(number)
    worker.close()
    assert done == list(range(100))


def test_background_passes_a_failure_on():
    def fail(_: int) -> None:
        raise OSError("disk full")

    worker = Background(fail, depth=1)
    with pytest.raises(OSError, match="disk full"):
        for number in range(100):
            worker.put(number)
    worker.close()


def test_background_fails_on_close_at_the_latest():
    def fail(_: int) -> None:
        raise OSError("disk full")

    worker = Background(fail, depth=8)
    worker.put(1)
    with pytest.raises(OSError, match="disk full"):
        worker.close()


def test_ahead_that_is_broken_off_while_its_thread_begins_makes_no_more(monkeypatch):
    closed = threading.Event()

    def numbers():
        try:
            yield from range(100)
        finally:
            closed.set()

    begin = threading.Thread.start

    def broken_off(thread):
        begin(thread)
        raise KeyboardInterrupt

    monkeypatch.setattr(threading.Thread, "start", broken_off)
    with pytest.raises(KeyboardInterrupt):
        next(ahead(numbers()))
    assert closed.wait(5)


def test_ahead_ends_where_no_more_threads_may_be_started(monkeypatch):
    def refused(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    with pytest.raises(RuntimeError, match="can't start"):
        next(ahead(iter(range(5))))


def test_ahead_ends_though_its_maker_fails_while_it_is_closed():
    """As a file may that is closed on a disk that is gone."""
    closed = []

    def numbers():
        try:
            yield from range(100)
        finally:
            closed.append(True)
            raise OSError("disk is gone")

    items = ahead(numbers())
    assert next(items) == 0
    closing = threading.Thread(target=items.close, daemon=True)
    closing.start()
    closing.join(5)
    assert closed and not closing.is_alive()


def test_background_closes_though_its_thread_is_not_quite_over_when_it_fails(monkeypatch):
    begin = threading.Event()

    def work(item):
        begin.wait(5)
        raise OSError("disk full")

    worker = Background(work, depth=1)
    over = worker._over.set
    monkeypatch.setattr(worker._over, "set", lambda: (time.sleep(0.5), over()))
    worker.put(1)
    worker.put(2)
    begin.set()
    with pytest.raises(OSError, match="disk full"):
        for _ in range(100):
            worker.put(3)
            time.sleep(0.01)
    closing = threading.Thread(target=worker.close, daemon=True)
    closing.start()
    closing.join(5)
    assert not closing.is_alive()


@contextmanager
def ctrl_c_soon():
    def send():
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    timer = threading.Timer(0.1, send)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
@pytest.mark.parametrize("stage", [ahead, lambda items: in_parallel(slow, items, workers=2)])
def test_a_stage_that_is_closed_has_no_thread_at_work_even_if_that_is_broken_off(stage):
    def numbers():
        for k in range(100):
            slow(k)
            yield k

    at_work.clear()
    items = stage(numbers())
    next(items)
    with pytest.raises(KeyboardInterrupt), ctrl_c_soon():
        items.close()
    assert at_work == []


at_work = []


def slow(item):
    at_work.append(item)
    time.sleep(0.4)
    at_work.remove(item)
    return item


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_what_is_broken_off_while_it_closes_works_on_no_more():
    """A signal may come while the last items are waited for, after which a video is closed below its thread."""
    done = []

    def work(item):
        time.sleep(0.3)
        done.append(item)

    worker = Background(work, depth=8)
    for item in range(5):
        worker.put(item)
    with pytest.raises(KeyboardInterrupt), ctrl_c_soon():
        worker.close()
    assert done == [0]
    time.sleep(0.4)
    assert done == [0]
