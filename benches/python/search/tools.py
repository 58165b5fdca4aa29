"""Other Python libraries with searches, each with its default and with common settings.

A tool is ``(name, setting, search)``. ``search(objective, seed)`` uses the evaluations of the objective; its result is
``objective.best``. A search that exceeds its evaluations is ended.
"""

import logging

import mealpy
import numpy as np
import pygmo
import pyswarms
import scipy.optimize


def scipy_de(strategy="best1bin", members=15, polish=True, cores=False):
    """`members`: population per variable. `polish`: L-BFGS-B from the best member, with 10 % of the evaluations."""

    def search(objective, seed):
        population = members * objective.dimensions
        evaluations = objective.evaluations * (0.9 if polish else 1.0)
        scipy.optimize.differential_evolution(
            (lambda x: objective.costs(x.T) if x.ndim == 2 else objective.cost(x)) if cores else objective.cost,
            list(zip(objective.lower, objective.upper)),
            strategy=strategy,
            popsize=members,
            maxiter=int(evaluations / population) - 1,
            tol=0.0,
            atol=0.0,
            polish=polish,
            vectorized=cores,
            updating="deferred" if cores else "immediate",
            rng=seed,
        )

    used = "all cores" if cores else "one core"
    setting = f"{strategy}, {members} members per variable{', then L-BFGS-B' if polish else ''}, {used}"
    return ("scipy", setting, search)


class Problem:
    """Interface of a problem for pygmo."""

    def __init__(self, objective):
        self.objective = objective

    def fitness(self, x):
        return [self.objective.cost(x)]

    def get_bounds(self):
        return self.objective.lower, self.objective.upper

    def __deepcopy__(self, _):
        # pygmo copies problems, but there must be only one counter.
        return self


def pygmo_search(name, make, members):
    def search(objective, seed):
        population = pygmo.population(pygmo.problem(Problem(objective)), size=members, seed=seed)
        # One generation more than possible, so that the budget ends the search.
        generations = objective.evaluations // members
        pygmo.algorithm(make(gen=generations, ftol=0.0, xtol=0.0, seed=seed)).evolve(population)

    return ("pygmo", f"{name}, population {members}", search)


def pyswarms_search(options, particles, bounds="periodic"):
    """`bounds`: handling of a particle outside the bounds; periodic is the default."""

    def search(objective, seed):
        np.random.seed(seed)
        swarm = pyswarms.single.GlobalBestPSO(
            n_particles=particles,
            dimensions=objective.dimensions,
            options=options,
            bounds=(objective.lower, objective.upper),
            bh_strategy=bounds,
        )
        swarm.optimize(objective.costs, iters=objective.evaluations // particles, verbose=False)

    w, c1, c2 = options["w"], options["c1"], options["c2"]
    return ("pyswarms", f"global best, w {w}, c1 {c1}, c2 {c2}, {particles} particles, {bounds} bounds, all cores", search)


def mealpy_search(name, kind, members, **settings):
    def search(objective, seed):
        problem = {
            "bounds": mealpy.FloatVar(lb=objective.lower, ub=objective.upper),
            "obj_func": objective.cost,
            "minmax": "min",
            "log_to": None,
        }
        kind(epoch=objective.evaluations // members, pop_size=members, **settings).solve(problem, seed=seed)

    return ("mealpy", f"{name}, population {members}", search)


def tools():
    logging.getLogger("pyswarms").setLevel(logging.ERROR)
    entries = [
        scipy_de(),
        scipy_de(cores=True),
        scipy_de(members=5),
        scipy_de(members=5, polish=False),
        scipy_de(strategy="rand1bin", members=5),
    ]
    for members in (20, 50, 100):
        entries.append(pygmo_search("de (rand/1/exp)", pygmo.de, members))
        entries.append(pygmo_search("sade, jDE", pygmo.sade, members))
        entries.append(pygmo_search("sade, iDE", lambda **k: pygmo.sade(variant_adptv=2, **k), members))
        entries.append(pygmo_search("de1220, jDE", pygmo.de1220, members))
        entries.append(pygmo_search("de1220, iDE", lambda **k: pygmo.de1220(variant_adptv=2, **k), members))
    for particles in (20, 50, 100):
        entries.append(pyswarms_search({"c1": 0.5, "c2": 0.3, "w": 0.9}, particles))
        entries.append(pyswarms_search({"c1": 1.49618, "c2": 1.49618, "w": 0.7298}, particles))
        entries.append(pyswarms_search({"c1": 1.49618, "c2": 1.49618, "w": 0.7298}, particles, "nearest"))
    for members in (20, 50, 100):
        entries.append(mealpy_search("L_SHADE", mealpy.SHADE.L_SHADE, members))
        entries.append(mealpy_search("OriginalSHADE", mealpy.SHADE.OriginalSHADE, members))
        entries.append(mealpy_search("JADE", mealpy.DE.JADE, members))
        entries.append(mealpy_search("OriginalDE", mealpy.DE.OriginalDE, members))
    return entries
