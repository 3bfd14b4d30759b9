import sys, subprocess, time
from benchmarks.station import viewers as V, viewer_crowd
from benchmarks.station.station_process import ended
shape = V.SHAPES[int(sys.argv[1])]
robots, rate, n, readers = shape
with V.station_of(robots, rate) as station:
    crowd = viewer_crowd.begin(station.url, station.token, n, readers, V.MEASURE_S, stalled=True)
    with ended(crowd):
        viewer_crowd.ready(crowd)
        cpu, t = station.cpu_s(), time.monotonic()
        if len(sys.argv) > 2:
            subprocess.run(["/tmp/spyenv/bin/py-spy","record","-n" if 0 else "-t","-p",str(station.process.pid),"-d","12","-r","200","-f","raw","-o",sys.argv[2]],check=False)
        seen = viewer_crowd.end(crowd)
        print("cpu %", 100*(station.cpu_s()-cpu)/(time.monotonic()-t), "batches", seen.batches, "age", viewer_crowd.age_ms(seen,95), "ans", viewer_crowd.answer_ms(seen,95), len(seen.answers_ms))
