#!/usr/bin/env python3
"""Prints the robot's pose: `slamd --port PORT --listen`, then `examples/watch.py [HOST:PORT]`."""
import json, signal, socket, sys; signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # `| head` ends it quietly
host, port = (sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:9878").split(":")
with socket.create_connection((host, int(port))) as server:
    server.sendall(b'?WATCH={"pose_hz":5};\n')
    for line in server.makefile(encoding="utf-8"):
        report = json.loads(line)
        if report["class"] == "POSE":
            print("{time_s:.1f} s: x {x_m:.2f} m, y {y_m:.2f} m, heading {theta_rad:.2f} rad".format(**report), flush=True)
