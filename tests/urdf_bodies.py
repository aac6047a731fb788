"""Random URDF files, and an impact on their links as free bodies that joints tie together.

Of kickdyn and Pinocchio nothing: placements, inertias and joints are read off the XML, each link
has six velocities, and every joint is rows that its impulses enforce, in one linear system. A mimic
joint is one row more.
"""

from xml.etree import ElementTree

import numpy as np


def _numbers(*values):
    return " ".join(repr(float(value)) for value in values)


def _inertial(mass, moments, xyz=(0, 0, 0), rpy=(0, 0, 0)):
    moments = "".join(
        f' i{axes}="{x!r}"' for axes, x in zip(("xx", "yy", "zz"), moments, strict=True)
    )
    return (
        f'<inertial><origin xyz="{_numbers(*xyz)}" rpy="{_numbers(*rpy)}"/><mass value="{mass!r}"/>'
        f'<inertia{moments} ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _sound(rng, share=1.0):
    a, b, c = (share * rng.uniform(0.001, 0.05, size=3)).tolist()  # sums keep the triangle
    place = rng.uniform(-0.2, 0.2, 3), rng.uniform(-3, 3, 3)
    return _inertial(share * rng.uniform(0.2, 8), (a + b, b + c, c + a), *place)


def _joint(rng, kind, parent, child, extra=""):
    axis = rng.normal(size=3)
    return (
        f'<joint name="{child.replace("l", "j")}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{_numbers(*rng.uniform(-0.4, 0.4, 3))}" '
        f'rpy="{_numbers(*rng.uniform(-3, 3, 3))}"/>'
        f'<axis xyz="{_numbers(*(axis / np.linalg.norm(axis)))}"/>'
        f'<limit lower="-3" upper="3" effort="9" velocity="9"/>{extra}</joint>'
    )


def random_urdf(rng, mimics=0):
    """A tree of 2 to 6 moving joints of all kinds, each with a sound link and odd ones fixed to it.

    Fixed links: a massless one, an impossible one of rounding size, one of mass, none.
    """
    count = int(rng.integers(2 + mimics, 7))
    odd = (_inertial(0, (0, 0, 0)), _inertial(1e-13, (1e-14, 1e-14, 3e-14)), _sound(rng, 0.3), "")
    parts, parents = [f'<link name="l0">{_sound(rng)}</link>'], ["l0"]
    for k in range(1, count + 1):
        kind, gear = ("revolute", "revolute", "prismatic", "continuous")[rng.integers(4)], ""
        if mimics and (k <= 2 or count - mimics < k):
            turns = k == 1 or rng.random() < 0.7
            kind = rng.choice(["revolute", "continuous"]) if turns else "prismatic"
        if count - mimics < k:
            gear = (
                f'<mimic joint="{rng.choice(["j1", "j2"])}" multiplier="{rng.uniform(-2, 2)!r}" '
                f'offset="{rng.uniform(-1, 1)!r}"/>'
            )
        parent = parents[int(rng.integers(max(0, len(parents) - 2), len(parents)))]
        parts += [
            f'<link name="l{k}">{_sound(rng)}</link>',
            _joint(rng, kind, parent, f"l{k}", gear),
        ]
        parts += [f'<link name="l{k}x">{odd[rng.integers(4)]}</link>']
        parts += [_joint(rng, "fixed", f"l{k}", f"l{k}x")]
        parents.append(f"l{k}")
    toe = _joint(rng, "fixed", f"l{rng.integers(1, count + 1)}x", "toe")
    return f'<robot name="tree">{"".join(parts)}<link name="toe"/>{toe}</robot>'


def _rotation(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x


def skew(a):
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def _about(axis, angle):
    cross = skew(axis)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _place(element):
    origin = None if element is None else element.find("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), float) for key in ("xyz", "rpy"))
    return _rotation(rpy), xyz


class Bodies:
    """The links of a URDF at joint values, with the base fixed or at a pose (rotation, origin)."""

    def __init__(self, text, values, base=None):
        root = ElementTree.fromstring(text)
        self.joints = {joint.get("name"): joint for joint in root.findall("joint")}
        child_of = {j.find("child").get("link"): n for n, j in self.joints.items()}
        elements = {link.get("name"): link for link in root.findall("link")}
        self.floats = base is not None
        self.number, self.places, self.axes = {}, {}, {}

        def place(link):
            if link not in self.places:
                name = child_of.get(link)
                if name is None:
                    self.places[link] = base or (np.eye(3), np.zeros(3))
                else:
                    joint = self.joints[name]
                    turn, at = place(joint.find("parent").get("link"))
                    own, offset = _place(joint)
                    turn, at = turn @ own, at + turn @ offset
                    axis = np.array(joint.find("axis").get("xyz").split(), float)
                    self.axes[name], value = turn @ axis, values.get(name, 0.0)
                    if joint.get("type") == "prismatic":
                        at = at + self.axes[name] * value
                    elif joint.get("type") != "fixed":
                        turn = turn @ _about(axis, value)
                    self.places[link] = turn, at
                self.number[link] = len(self.number)
            return self.places[link]

        for link in elements:
            place(link)
        n = len(self.number)
        self.mass, self.centres = np.zeros((6 * n, 6 * n)), np.zeros((n, 3))
        for link, k in self.number.items():
            turn, at = self.places[link]
            inertial = elements[link].find("inertial")
            own, offset = _place(inertial)
            self.centres[k] = at + turn @ offset
            if inertial is not None:
                inertia, axes = inertial.find("inertia"), turn @ own
                moments = np.diag([float(inertia.get(key)) for key in ("ixx", "iyy", "izz")])
                linear, angular = slice(6 * k, 6 * k + 3), slice(6 * k + 3, 6 * k + 6)
                self.mass[linear, linear] = float(inertial.find("mass").get("value")) * np.eye(3)
                self.mass[angular, angular] = axes @ moments @ axes.T
        self._tie()

    def motion(self, link, point):
        """Rows that give a link's velocity at a point, linear then angular."""
        rows, k = np.zeros((6, len(self.mass))), self.number[link]
        rows[:3, 6 * k : 6 * k + 3] = rows[3:, 6 * k + 3 : 6 * k + 6] = np.eye(3)
        rows[:3, 6 * k + 3 : 6 * k + 6] = -skew(point - self.centres[k])
        return rows

    def _tie(self):
        """Rows of all joints; for each, its share of them as wrenches on the child."""
        rows, self.wrenches, self.rates, start = [], {}, {}, 0
        if not self.floats:
            base = next(iter(self.number))
            rows.append(self.motion(base, self.places[base][1]))
            start = 6
        for name, joint in self.joints.items():
            child, parent = (joint.find(role).get("link") for role in ("child", "parent"))
            point = self.places[child][1]
            relative = self.motion(child, point) - self.motion(parent, point)
            across = np.eye(6)
            if joint.get("type") != "fixed":
                slides = joint.get("type") == "prismatic"
                free = np.concatenate([self.axes[name] * slides, self.axes[name] * (not slides)])
                across = np.linalg.svd(free.reshape(1, 6))[2][1:]
                self.rates[name] = free, free @ relative
            rows.append(across @ relative)
            self.wrenches[name] = [(slice(start, start + len(across)), across)]
            start += len(across)
        for name, joint in self.joints.items():
            mimic = joint.find("mimic")
            if mimic is not None:
                driver, ratio = mimic.get("joint"), float(mimic.get("multiplier"))
                rows.append((self.rates[name][1] - ratio * self.rates[driver][1])[None])
                for joined, share in ((name, 1.0), (driver, -ratio)):
                    gear = share * self.rates[joined][0][None]
                    self.wrenches[joined].append((slice(start, start + 1), gear))
                start += 1
        self.rows = np.vstack(rows)

    def velocities(self, rates, base_twist=None):
        """Velocities of all bodies, from those of joints and of the base [world axes]."""
        tied, right = [self.rows], [np.zeros(len(self.rows))]
        for name, rate in rates.items():
            tied.append(self.rates[name][1][None])
            right.append([rate])
        if self.floats:
            base = next(iter(self.number))
            tied.append(self.motion(base, self.places[base][1]))
            right.append(base_twist)
        return np.linalg.lstsq(np.vstack(tied), np.concatenate(right), rcond=None)[0]

    def struck(self, before, link, impulse):
        """Velocities after an impulse at the link's origin, and the wrench of each joint there."""
        n, m = len(self.mass), len(self.rows)
        system = np.block([[self.mass, -self.rows.T], [self.rows, np.zeros((m, m))]])
        foot = self.motion(link, self.places[link][1])[:3]
        right = np.concatenate([self.mass @ before + foot.T @ impulse, np.zeros(m)])
        answer = np.linalg.solve(system, right)
        wrenches = {
            name: sum(part.T @ answer[n:][at] for at, part in parts)
            for name, parts in self.wrenches.items()
        }
        return answer[:n], wrenches

    def energy(self, velocities):
        return 0.5 * velocities @ self.mass @ velocities

    def momentum(self, velocities):
        """Linear, and angular about the world's origin."""
        momenta = (self.mass @ velocities).reshape(-1, 6)
        turning = momenta[:, 3:] + np.cross(self.centres, momenta[:, :3])
        return np.concatenate([momenta[:, :3].sum(axis=0), turning.sum(axis=0)])
