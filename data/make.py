"""Makes the recordings of this folder: python3 make.py FOLDER cuts those of others from their originals, and
python3 make.py alone makes those that are ours.

FOLDER holds `UAV_Rot.csv` of Stone Soup (docs/demos) and `scenario2_detections.json` and
`scenario2_groundTruth.json` of the Autoferry sensor fusion dataset, anywhere below it. README.md says what comes out.
"""

import json
import math
import random
import sys
from decimal import Decimal
from pathlib import Path

HERE = Path(__file__).parent
FIRST_ROW, ROWS = 91, 300  # of the log, the header not counted
RADAR = 2
GATE_M = 25.0


def find(folder, name):
    return next(Path(folder).rglob(name))


def cut_uav(folder):
    lines = find(folder, "UAV_Rot.csv").read_text().splitlines(keepends=True)
    (HERE / "uav.csv").write_text("".join([lines[0], *lines[FIRST_ROW : FIRST_ROW + ROWS]]))


def load(folder, name):
    """Numbers as decimals: times keep every digit of the file."""
    return json.loads(find(folder, name).read_text(), parse_float=Decimal)


def between(points, time):
    """North and east on the straight line between the two truth points around `time`; None outside."""
    for (t0, p0), (t1, p1) in zip(points, points[1:]):
        if t0 <= time <= t1:
            share = (time - t0) / (t1 - t0)
            return [a + (b - a) * share for a, b in zip(p0, p1)]
    return None


def row(time, target, north, east):
    return f"{time.quantize(Decimal('1e-9')).normalize():f},{target},{east:.3f},{north:.3f}\n"


def make_ferry(folder):
    scans = load(folder, "scenario2_detections.json")
    truth = {}
    for record in load(folder, "scenario2_groundTruth.json"):
        for target in record:
            truth.setdefault(target["targetID"], {})[target["time"]] = target["position"][:2]
    truth = {target: sorted(points.items()) for target, points in sorted(truth.items())}

    header = "time_s,id,x_m,y_m\n"
    detections, positions = [header], [header]
    for scan in scans:
        if scan["sensorID"] != RADAR:
            continue
        own = scan["ownshipPosition"]
        found = [(n + own[0], e + own[1]) for n, e in zip(*scan["measurement"])]
        places = {target: between(points, scan["time"]) for target, points in truth.items()}
        places = {target: place for target, place in places.items() if place is not None}
        taken = {}
        for detection in found:
            distance, target = min((math.dist(detection, place), target) for target, place in places.items())
            if distance <= GATE_M:
                taken[target] = min(taken.get(target, (math.inf,)), (distance, detection))
        for target, place in places.items():
            positions.append(row(scan["time"], target, *place))
            if target in taken:
                detections.append(row(scan["time"], target, *taken[target][1]))
    (HERE / "ferry_radar.csv").write_text("".join(detections))
    (HERE / "ferry_truth.csv").write_text("".join(positions))


def make_turning():
    """A long vehicle on winding ground, of which a sensor that moves along sees the left side and the front."""
    draws = random.Random(1)
    speed, scans, steps = 3.0, 50, 100
    length, width, error = 12.0, 5.0, 0.15
    share = length / (length + width)
    # The middle of the points, from that of the vehicle.
    middle = ((1 - share) * length / 2, share * width / 2)
    points, truth = ["time_s,x_m,y_m\n"], ["time_s,x_m,y_m,vx_mps,vy_mps\n"]
    x, y, angle = 0.0, 0.0, 0.6
    for scan in range(scans):
        sin, cos = math.sin(angle), math.cos(angle)

        def placed(ahead, left):
            return x + ahead * cos - left * sin, y + ahead * sin + left * cos

        # A Poisson number of mean 10 (Knuth, The Art of Computer Programming, 3.4.1).
        count, product = 0, draws.random()
        while product > math.exp(-10):
            count, product = count + 1, product * draws.random()
        for _ in range(count):
            side = draws.random() < share
            ahead = (draws.random() - 0.5) * length if side else length / 2
            left = width / 2 if side else (draws.random() - 0.5) * width
            px, py = placed(ahead + draws.gauss(0, error), left + draws.gauss(0, error))
            points.append(f"{scan},{px:.2f},{py:.2f}\n")
        mx, my = placed(*middle)
        rate = turn_rate(scan)
        # The middle of the points turns about that of the vehicle.
        vx, vy = speed * cos - rate * (my - y), speed * sin + rate * (mx - x)
        truth.append(f"{scan},{mx:.3f},{my:.3f},{vx:.3f},{vy:.3f}\n")
        for step in range(steps):
            turned = turn_rate(scan + (step + 0.5) / steps) / steps
            x += speed / steps * math.cos(angle + turned / 2)
            y += speed / steps * math.sin(angle + turned / 2)
            angle += turned
    (HERE / "turning.csv").write_text("".join(points))
    (HERE / "turning_truth.csv").write_text("".join(truth))


def turn_rate(time):
    """Radians per second: a bend to the right and one to the left."""
    return -0.12 * math.cos(math.tau * (time - 12) / 48)


if __name__ == "__main__":
    make_turning()
    if len(sys.argv) > 1:
        cut_uav(sys.argv[1])
        make_ferry(sys.argv[1])
