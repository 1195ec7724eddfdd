"""The firmware as a program of this machine: the C sources on an averaged motor, faster than real time."""
