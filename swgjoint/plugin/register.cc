#include <mujoco/mujoco.h>

#include "drive.h"

mjPLUGIN_LIB_INIT(swgjoint_drive) {
  // another MuJoCo version may have a different layout of mjModel and mjData
  if (mj_version() != mjVERSION_HEADER) {
    mju_warning("swgjoint.drive was built for MuJoCo %d, not for %d; not registered",
                mjVERSION_HEADER, mj_version());
    return;
  }
  swgjoint::Drive::RegisterPlugin();
}
