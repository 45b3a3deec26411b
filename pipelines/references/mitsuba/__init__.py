"""The second opinion: Mitsuba 3 traces the scene, for comparisons with `--reference mitsuba`.

A pipeline of one node (`plugin/`) asks a `process.Tracer` for light. Its process turns the scene's arrays, which
`convert` prepares, into shapes with surfaces and lights of our own (`surfaces`, `lights`), and traces them (`render`).
No other process imports Mitsuba.
"""
