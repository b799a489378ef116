"""Who is there and where, from a hub of slamd-fleet on this machine.

Needs: python3 -m venv ~/zenoh && ~/zenoh/bin/pip install eclipse-zenoh==1.10.2; then ~/zenoh/bin/python watch.py ..."""
import json, sys, zenoh
hub, site, poses = sys.argv[1], sys.argv[2], int(sys.argv[3]) if len(sys.argv) > 3 else sys.maxsize
config = zenoh.Config.from_json5(json.dumps({
    "mode": "client", "connect": {"endpoints": [hub]}, "scouting": {"multicast": {"enabled": False}}}))
with zenoh.open(config) as session:
    for reply in session.liveliness().get(f"slamd/{site}/*/alive"):
        print("alive", reply.ok.key_expr, flush=True)
    with session.declare_subscriber(f"slamd/{site}/*/pose") as heard:
        for _, sample in zip(range(poses), heard):
            pose = json.loads(sample.payload.to_string())
            print(sample.key_expr, "{time_us} us: x {x_m:.2f} m, y {y_m:.2f} m".format(**pose), flush=True)
    for reply in session.get(f"slamd/{site}/*/map"):
        if reply.err is not None:
            print("no map:", reply.err.payload.to_string(), flush=True)
            continue
        grid = reply.ok.payload.to_bytes()
        print(reply.ok.key_expr, f"version {grid[0]}, {len(grid)} bytes", flush=True)
