# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # From the log of a test bench to a drive in a scene
#
# A drive stands on a bench: its motor swings the link there and back while a brake
# loads it, and a logger writes time, both angles and both torques. Here the bench is
# the simulator, with a drive whose hysteresis and kinematic error no catalogue states,
# and sensors with noise. The same lines take the file of a real bench; on the command
# line it is `swgjoint identify bench.csv --teeth 200/202 --rated 87 --out found`.

# %%
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import numpy as np

from swgjoint.identify.identification import identify
from swgjoint.identify.log import read_log
from swgjoint.maps.drive_map import DriveMap
from swgjoint.maps.hysteresis import Jenkin
from swgjoint.sim.scene.scene import Scene
from swgjoint.units import arcmin
from swgjoint.view.plots.identification import picture
from swgjoint.view.run import run_scene

catalogue = DriveMap.from_catalogue("CSG-25-100", kinematic_error_arcmin=0.0)


def true_drive() -> DriveMap:
    """The drive on the bench: 0.5 arcmin at 2 and 4 per turn, hysteresis of 3 N·m."""
    potential = np.zeros((3, *catalogue.potential.shape[1:]))
    potential[0] = catalogue.potential[0]
    ends = np.zeros((3, 2, 2))
    ends[0] = catalogue.end_stiffness[0]
    return replace(
        catalogue,
        name="bench drive",
        orders=np.array([(0, 0), (2, 0), (4, 0)]),
        potential=potential,
        end_stiffness=ends,
        kinematic_error=1e-4 * np.array([[0, 0], [1.2, -0.6], [0.3, 0.5]]),
        hysteresis=(Jenkin(stiffness=1.2e4, yield_torque=3.0),),
    )


# %% [markdown]
# ## The bench writes its log

# %%
bench = {
    "name": "bench",
    "arm": "bench",
    "defaults": {
        "drive": "drive",
        "level": "full",
        "rotor_inertia_kgm2": 4e-5,
        "friction": True,
    },
    "trajectory": {
        "kind": "chirp",
        "joint": "joint",
        "amplitude_deg": 15.0,
        "from_Hz": 0.1,
        "to_Hz": 0.6,
        "hold_s": 0.1,
    },
    "disturbance": [
        {
            "kind": "joint_sine",
            "joint": "joint",
            "torque_Nm": 110.0,
            "frequency_Hz": 0.43,
        }
    ],
    "simulation": {"duration_s": 10.0, "step_s": 5e-4, "integrator": "RK4"},
}
run = run_scene(Scene.from_data(bench), drives={"drive": true_drive()})
rng = np.random.default_rng(0)


def logged(signal: np.ndarray, deviation: float) -> np.ndarray:
    """Mean over every sample's period, with noise."""
    mean = 0.5 * (signal[1:, 0] + signal[:-1, 0])
    return mean + deviation * rng.normal(size=len(mean))


columns = {
    "time_s": 0.5 * (run.time[1:] + run.time[:-1]),
    "motor_angle_rad": logged(run.motor_position, 1e-5),
    "link_angle_rad": logged(run.position, 2e-6),
    "output_torque_Nm": logged(run.output_torque, 0.5),
    # a run has the torque of the motor beside the state that it led to
    "motor_torque_Nm": run.motor_torque[1:, 0]
    + 5e-3 * rng.normal(size=len(run.time) - 1),
}

# %% [markdown]
# ## Parameters with their intervals
#
# The torques at which the stiffness changes are those of the catalogue, as are the
# teeth; all else comes from the log. The intervals tell what noise does, not what the
# averages leave out: this motor turns at up to 107 rad/s, its error of 4 per turn by
# 2 rad in the 5 ms that are the default window, which puts hysteresis, viscous friction
# and inertia 2 to 3 % off, outside their intervals (a note says so). A window of 1 ms
# leaves 0.6 % at most, in narrower intervals.

# %%
with TemporaryDirectory() as folder:
    path = Path(folder) / "bench.csv"
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="")
    found = identify(
        read_log(path),
        teeth_flexspline=200,
        teeth_circular_spline=202,
        ratings=catalogue.ratings,
        orders=[(2, 0), (4, 0)],
        window=0.001,
    )
stated, law = catalogue.info["stated"], catalogue.friction
truth = {f"K{k}": stated[f"K{k}_Nm_rad"] for k in (1, 2, 3)} | {
    "hysteresis_yield_torque": 3.0,
    "error_2_0_cos": 1.2e-4,
    "error_2_0_sin": -0.6e-4,
    "friction_coulomb": law.coulomb,
    "friction_load": law.load,
    "friction_viscous": law.viscous,
    "rotor_inertia": 4e-5,
}
for name, true in truth.items():
    e = found.estimates[name]
    print(f"{name:24s} {e.value:10.4g} [{e.low:.4g}, {e.high:.4g}]  true {true:.4g}")
    assert abs(e.value / true - 1.0) < 0.02

# %%
image = BytesIO()
picture(found).savefig(image, format="png")
image.seek(0)
plt.figure(figsize=(11, 9))
plt.imshow(plt.imread(image))
plt.axis("off")
plt.show()

# %% [markdown]
# ## The found drive in a scene of its own
#
# Another motion, a chirp to 4 Hz under a constant load: the drive as the catalogue has
# it, the found one, and the true one that the bench never told us.

# %%
other = {
    **bench,
    "trajectory": {**bench["trajectory"], "amplitude_deg": 3.0, "to_Hz": 4.0},
    "disturbance": [],
    "load": {"joint": {"torque_Nm": 30.0}},
    "simulation": {"duration_s": 3.0, "step_s": 1e-3},
}
drives = {"true": true_drive(), "found": found.drive, "catalogue": catalogue}
error = {}
for name, drive in drives.items():
    got = run_scene(Scene.from_data(other), drives={"drive": drive})
    error[name] = (got.position - got.reference)[:, 0] / arcmin
for name in ("catalogue", "found"):
    plt.plot(got.time, error[name] - error["true"], label=name, lw=1)
plt.xlabel("time [s]")
plt.ylabel("link, off that of the true drive [arcmin]")
plt.legend()
plt.show()
missed = {k: float(np.std(error[k] - error["true"])) for k in ("found", "catalogue")}
print({k: f"{v:.3f} arcmin rms off the true drive" for k, v in missed.items()})
assert missed["found"] < 0.2 * missed["catalogue"]
