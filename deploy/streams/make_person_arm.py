#!/usr/bin/env python3
"""Writes person_arm.csv: the arm of a person who reaches out, sweeps sideways and draws back, as six spheres.

The shoulder is the origin, x points forward, z up; a scene places it with perception.stream.position_m and rpy_rad.
Upper arm 0.30 m, forearm 0.27 m, 12 s at 30 Hz; the motion closes on itself, so the stream can loop.
"""
import math

RATE_HZ, DURATION_S = 30, 12
UPPER_M, FORE_M, HAND_M = 0.30, 0.27, 0.08
RADII_M = (0.09, 0.07, 0.06, 0.055, 0.045, 0.06)  # shoulder, upper arm, elbow, forearm, wrist, hand


def along(yaw, pitch, length):
    return (length * math.cos(pitch) * math.cos(yaw), length * math.cos(pitch) * math.sin(yaw), length * math.sin(pitch))


def plus(a, b, part=1.0):
    return tuple(x + part * y for x, y in zip(a, b))


def arm(t):
    turn = 2 * math.pi * t / DURATION_S
    yaw = 0.6 * math.sin(2 * turn)                      # across, twice
    pitch = -0.2 + 0.2 * math.sin(3 * turn + 0.5)       # up and down, three times
    flex = 0.6 + 0.5 * math.cos(2 * turn + 0.4)         # elbow
    upper, fore = along(yaw - flex / 2, pitch - 0.2, UPPER_M), along(yaw + flex / 2, pitch + 0.3, FORE_M)
    hand = along(yaw + flex / 2, pitch + 0.3, HAND_M)
    shoulder = (0.0, 0.0, 0.0)
    elbow = plus(shoulder, upper)
    wrist = plus(elbow, fore)
    return (shoulder, plus(shoulder, upper, 0.5), elbow, plus(elbow, fore, 0.5), wrist, plus(wrist, hand))


def main():
    with open("person_arm.csv", "w", newline="\n") as out:
        out.write("t_s,id,x_m,y_m,z_m,radius_m\n")
        for k in range(RATE_HZ * DURATION_S):
            t = k / RATE_HZ
            for i, (p, r) in enumerate(zip(arm(t), RADII_M)):
                out.write(f"{t:.6f},{i},{p[0]:.4f},{p[1]:.4f},{p[2]:.4f},{r}\n")


if __name__ == "__main__":
    main()
