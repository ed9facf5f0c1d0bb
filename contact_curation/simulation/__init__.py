"""The simulated world in MuJoCo: board, tossed body, robot arm, camera and tracker."""
