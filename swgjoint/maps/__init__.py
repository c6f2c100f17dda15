"""Maps of drives: the reduced torque and error model, its fit, file and spec sheet."""
