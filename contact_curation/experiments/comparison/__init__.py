"""The family of selection rules compared on several bodies, judged by two engines, with intervals over seeds and judges."""
