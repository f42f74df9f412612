"""Lists the built-in controllers by name. Files may use only these names, because other names run code."""

from fowt_env.controllers.constant import constant
from fowt_env.controllers.floating_feedback import floating_feedback
from fowt_env.controllers.gspi import gspi_land, gspi_oc3
from fowt_env.controllers.ipc.law import ipc, ipc_constrained, ipc_floating
from fowt_env.controllers.lqr.law import lqr
from fowt_env.controllers.mpc.clone import mpc_clone
from fowt_env.controllers.mpc.law import lq_preview, mpc, mpc_lidar, mpc_preview
from fowt_env.controllers.openfast_baseline import openfast_oc3
from fowt_env.controllers.pi import pi, pi_land, pi_land_power, pi_tuned, pi_unscheduled
from fowt_env.controllers.preview import preview
from fowt_env.controllers.printed_eq8 import eq8_literal
from fowt_env.controllers.rosco import rosco, rosco_float, rosco_ipc

FACTORIES = (  # (turbine: descriptions.turbine.Turbine, control_dt: float) -> controller
    constant, eq8_literal, floating_feedback, gspi_land, gspi_oc3, ipc, ipc_constrained, ipc_floating,
    lq_preview, lqr, mpc, mpc_clone, mpc_lidar, mpc_preview, openfast_oc3, pi, pi_land, pi_land_power,
    pi_tuned, pi_unscheduled, preview, rosco, rosco_float, rosco_ipc,
)  # fmt: skip
CONTROLLERS = {factory.__name__: factory for factory in FACTORIES}
