#!/usr/bin/env python3
"""CSRT of OpenCV beside `zerre otb` on the same sequences, one thread each, one after the other in the same run.

    pip install opencv-contrib-python
    cargo build --release
    python3 opencv.py --zerre ../../../../target/release/zerre --out /tmp/peers DIR...

DIR is a folder of the benchmark's layout (img/ and groundtruth_rect.txt). Writes OUT/csrt/SEQUENCE.txt (a box per line,
x,y,width,height from 1, as `zerre otb --results` reads them) and OUT/speed.json: frames per second of this thread's
processor time, decoding apart, medians over the repetitions. Both are timed in turn, so that a busy machine slows both.
"""
import argparse, glob, json, os, re, statistics, subprocess, time

import cv2


def boxes(folder):
    with open(os.path.join(folder, "groundtruth_rect.txt")) as file:
        return [[float(v) for v in re.split(r"[,\s]+", line.strip())] for line in file if line.strip()]


def csrt(folder):
    frames = [cv2.imread(f) for f in sorted(glob.glob(os.path.join(folder, "img", "*")))]
    x, y, w, h = boxes(folder)[0]
    box = (int(round(x - 1)), int(round(y - 1)), int(round(w)), int(round(h)))
    create = getattr(cv2, "TrackerCSRT_create", None) or cv2.TrackerCSRT.create
    since = time.thread_time()
    tracker = create()
    tracker.init(frames[0], box)
    found = [box]
    for frame in frames[1:]:
        good, box = tracker.update(frame)
        # A tracker that finds nothing stays where it was.
        found.append(box if good else found[-1])
    return found, (len(frames) - 1) / (time.thread_time() - since)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="DIR")
    parser.add_argument("--zerre", required=True, help="the program to measure beside it")
    parser.add_argument("--tracker", action="append", help="trackers of zerre; zerre by default")
    parser.add_argument("--out", required=True)
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    os.makedirs(os.path.join(options.out, "csrt"), exist_ok=True)
    speeds = {}
    for folder in options.folders:
        name = os.path.basename(os.path.normpath(folder))
        for turn in range(options.repeat):
            found, fps = csrt(folder)
            speeds.setdefault(("csrt", name), []).append(fps)
            for tracker in options.tracker or ["zerre"]:
                out = os.path.join(options.out, "zerre", name, f"{tracker}-{turn}")
                command = [options.zerre, "otb", folder, "--tracker", tracker, "--json", "--force", "--out", out]
                answer = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                for row in json.loads(answer)["rows"]:
                    if row["tracker"] == tracker:
                        speeds.setdefault((tracker, name), []).append(row["fps"])
        with open(os.path.join(options.out, "csrt", name + ".txt"), "w") as file:
            file.writelines(f"{x + 1},{y + 1},{w},{h}\n" for x, y, w, h in found)
    rows = [dict(tracker=t, sequence=s, fps=statistics.median(v)) for (t, s), v in speeds.items()]
    with open(os.path.join(options.out, "speed.json"), "w") as file:
        json.dump({"opencv": cv2.__version__, "rows": rows}, file, indent=1)
    mean = lambda tracker: statistics.mean(r["fps"] for r in rows if r["tracker"] == tracker)
    for tracker in dict.fromkeys(r["tracker"] for r in rows):
        print(f"{tracker:10} {mean(tracker):8.1f} fps, {mean(tracker) / mean('csrt'):5.2f} times CSRT")


if __name__ == "__main__":
    main()
