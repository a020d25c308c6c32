"""Plots of results. They need matplotlib; each function returns the axes, and draws into `ax` if it is given."""

from __future__ import annotations

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from ._result import Result

AXES = {
    "position": ("north", "east", "down"),
    "velocity": ("north", "east", "down"),
    "attitude": ("roll", "pitch", "yaw"),
}
UNITS = {"position": "m", "velocity": "m/s", "attitude": "°"}


def path(result: Result, *, ax: Any = None) -> Any:
    """The way from above, north up, in metres of the origin, with the reference where there is one."""
    place = result.estimates["local_position"]
    ax = ax or plt.subplots(layout="constrained")[1]
    ax.plot(place[:, 1], place[:, 0], label="estimate")
    if result.smoothed is not None:
        place = result.smoothed["local_position"]
        ax.plot(place[:, 1], place[:, 0], label="smoothed")
    errors = result.errors
    known = None if errors is None else ~np.isnan(errors.position[:, :2]).any(axis=1)
    if errors is not None and known is not None and known.any():
        time, place = result.estimates.time, result.estimates["local_position"]
        at = [np.interp(errors.time[known], time, place[:, k]) - errors.position[known, k] for k in (1, 0)]
        ax.plot(*at, "k--", lw=0.8, label="reference")
    ax.set(xlabel="east [m]", ylabel="north [m]")
    ax.set_aspect("equal", adjustable="datalim")
    ax.grid(alpha=0.3)
    ax.legend()
    return ax


def errors(result: Result, quantity: str = "position", *, sigma: float = 3, ax: Any = None) -> Any:
    """The errors of a quantity against the reference over time, within the band of `sigma` times its 1σ.

    `ax` is a sequence of three axes.
    """
    if result.errors is None:
        raise ValueError("the run has no reference: declare [reference] in the design")
    time, scale = result.errors.time, np.degrees(1) if quantity == "attitude" else 1
    error = scale * getattr(result.errors, quantity)
    spread = scale * getattr(result.errors.sigma, quantity)
    # An epoch of the reference may have other quantities only.
    known = ~np.isnan(error).all(axis=1)
    time, error, spread = time[known], error[known], spread[known]
    axes = plt.subplots(3, sharex=True, layout="constrained")[1] if ax is None else ax
    for k, name in enumerate(AXES[quantity]):
        axes[k].fill_between(time, -sigma * spread[:, k], sigma * spread[:, k], alpha=0.2, lw=0, label=f"{sigma:g}σ")
        axes[k].plot(time, error[:, k], lw=0.8)
        axes[k].set_ylabel(f"{name} [{UNITS[quantity]}]")
        axes[k].grid(alpha=0.3)
    axes[0].legend(loc="upper right")
    axes[0].set_title(f"errors of {quantity}")
    axes[2].set_xlabel("time [s]")
    return axes


def innovations(result: Result, sensor: str, *, sigma: float = 3, ax: Any = None) -> Any:
    """The innovations of a sensor over their predicted 1σ; rejected ones are red."""
    told = result.innovations[sensor]
    count = told.residual.shape[1]
    axes = plt.subplots(count, sharex=True, squeeze=False, layout="constrained")[1][:, 0] if ax is None else ax
    used = told.verdict == "accepted"
    for k in range(count):
        ratio = told.residual[:, k] / told.sigma[:, k]
        axes[k].axhspan(-sigma, sigma, alpha=0.15, lw=0)
        axes[k].plot(told.time[used], ratio[used], ".", ms=3)
        axes[k].plot(told.time[~used], ratio[~used], "r.", ms=4)
        axes[k].set_ylabel(f"row {k + 1} / 1σ")
        axes[k].grid(alpha=0.3)
    axes[0].set_title(f"innovations of {sensor}")
    axes[-1].set_xlabel("time [s]")
    return axes


def states(result: Result, name: str, *, sigma: float = 3, ax: Any = None) -> Any:
    """A state over time with the band of `sigma` times its 1σ, in SI."""
    time, values, spread = result.estimates.time, result.estimates[name], result.sigma[name]
    values, spread = (a[:, None] if a.ndim == 1 else a for a in (values, spread))
    ax = ax or plt.subplots(layout="constrained")[1]
    for k in range(values.shape[1]):
        (line,) = ax.plot(time, values[:, k], lw=1, label=f"{name}[{k}]" if values.shape[1] > 1 else name)
        if spread.shape == values.shape:
            low, high = values[:, k] - sigma * spread[:, k], values[:, k] + sigma * spread[:, k]
            ax.fill_between(time, low, high, alpha=0.15, lw=0, color=line.get_color())
    ax.set(xlabel="time [s]", title=name)
    ax.grid(alpha=0.3)
    ax.legend()
    return ax
