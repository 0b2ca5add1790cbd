"""Counts what the module of the page executes, by the fuel of wasmtime: a unit for an operator, the same on each machine."""

import wasmtime

# Ten times real time on one core, whatever the speed of this machine: a second of the tour has at most so many operators. Ten of
# them are 1.2e9, and an engine makes less than an instruction of an operator, for locals, constants and blocks cost none.
MOST = 120_000_000
TOUR_S = 10


def of_the_tour(module):
    """Returns the operators of a second of the tour, and the hash of its frames."""
    config = wasmtime.Config()
    config.consume_fuel = True
    engine = wasmtime.Engine(config)
    store = wasmtime.Store(engine)
    store.set_fuel(1 << 62)
    exports = wasmtime.Instance(store, wasmtime.Module(engine, module), []).exports(store)
    before = store.get_fuel()
    exports["run_tour"](store)
    count = (before - store.get_fuel()) // TOUR_S
    return count, f"{exports['hash'](store) & (1 << 64) - 1:016x}"
