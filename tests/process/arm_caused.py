"""Whose fault a contact was: the arm's, when its witness point moved towards the obstacle faster than 0.02 m/s in the last
0.1 s.  From a recording's states and reports, with kinematics of its own."""

import math
import xml.etree.ElementTree as ET

SPEED_MPS, WITHIN_S = 0.02, 0.1


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def apply(R, v):
    return [dot(row, v) for row in R]


def multiply(A, B):
    return [[sum(A[i][k] * B[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def about(axis, angle):
    c, s = math.cos(angle), math.sin(angle)
    x, y, z = axis
    return [[c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s],
            [y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s],
            [z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)]]


class Arm:
    """The revolute chain of a URDF whose base stands at the world's origin."""

    def __init__(self, path):
        joints = {j.find("child").get("link"): j for j in ET.parse(path).getroot().findall("joint")}
        parents = {j.find("parent").get("link") for j in joints.values()}
        chains = []
        for tip in set(joints) - parents:
            chain = []
            while tip in joints:
                chain.insert(0, joints[tip])
                tip = joints[tip].find("parent").get("link")
            chains.append(chain)
        self.chain = max(chains, key=lambda c: sum(j.get("type") in ("revolute", "continuous") for j in c))

    def axes(self, q):
        """(origin, direction) of each moving joint in the world."""
        R, p, out = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0], []
        for joint in self.chain:
            origin = joint.find("origin")
            read = lambda name: [float(v) for v in (origin.get(name) or "0 0 0").split()] if origin is not None else [0, 0, 0]
            p = [a + b for a, b in zip(p, apply(R, read("xyz")))]
            roll, pitch, yaw = read("rpy")
            for axis, angle in (([0, 0, 1], yaw), ([0, 1, 0], pitch), ([1, 0, 0], roll)):
                R = multiply(R, about(axis, angle))
            if joint.get("type") not in ("revolute", "continuous"):
                continue
            axis = [float(v) for v in joint.find("axis").get("xyz").split()]
            out.append((p, apply(R, axis)))
            if len(out) <= len(q):
                R = multiply(R, about(axis, q[len(out) - 1]))
        return out[:len(q)]

    def velocity(self, q, qd, link, point):
        v = [0, 0, 0]
        for j, (o, z) in enumerate(self.axes(q)[:link + 1]):
            v = [a + qd[j] * b for a, b in zip(v, cross(z, [x - y for x, y in zip(point, o)]))]
        return v


def numbers(row, name):
    return [float(row[f"{name}[{i}]"]) for i in range(64) if row.get(f"{name}[{i}]")]


def judge(urdf, states, reports):
    """(contacts of the arm's making, others): spells of touching, each link and obstacle by itself."""
    arm = Arm(urdf)
    caused = others = 0
    touching, towards = set(), {}
    times = [float(s["t_s"]) for s in states]
    for r in reports:
        t, seen = float(r["t_s"]), set()
        for i in range(64):
            if not r.get(f"links[{i}].link"):
                break
            pair = (int(r[f"links[{i}].link"]), r[f"links[{i}].obstacle"] if f"links[{i}].obstacle" in r else r[f"links[{i}].obstacle_id"])
            distance = float(r[f"links[{i}].distance_m"] or "inf")
            on_link, on_obstacle = numbers(r, f"links[{i}].point_on_link_m"), numbers(r, f"links[{i}].point_on_obstacle_m")
            gap = [b - a for a, b in zip(on_link, on_obstacle)]
            length = math.sqrt(dot(gap, gap))
            if distance > 1e-4 and length > 0:
                towards[pair] = [g / length for g in gap]
            if distance >= 0:
                continue
            seen.add(pair)
            if pair in touching:
                continue
            n = towards.get(pair) or ([-g / length for g in gap] if length > 0 else [0, 0, 0])
            fastest = max((dot(arm.velocity(numbers(s, "position"), numbers(s, "velocity"), pair[0], on_link), n)
                           for s, at in zip(states, times) if t - WITHIN_S <= at <= t), default=0)
            if fastest > SPEED_MPS:
                caused += 1
            else:
                others += 1
        touching = seen
    return caused, others
