-- How good are the estimates, by whatever one likes to tell apart?
--   FROM accuracy.metrics(['camera', 'class'])
--   FROM accuracy.metrics(['depth'], edges := [0, 5, 10, 20, 40])
-- A dimension that is not asked for is NULL; accuracy.metrics_by leaves its columns out. What the
-- figures and their intervals are is in accuracy.from_sums.
CREATE OR REPLACE MACRO accuracy.metrics(
    dimensions,
    edges := [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100],
    every_run := FALSE
) AS TABLE
WITH sums AS MATERIALIZED (
    FROM accuracy.sums(dimensions, edges := edges, every_run := every_run)
)
FROM accuracy.from_sums('sums', dimensions);

COMMENT ON MACRO TABLE accuracy.metrics IS 'How good are the estimates, by whatever one likes to tell apart? dimensions: a list of run, recording, camera, class, track, aperture, depth; edges: the borders of the depth bins in metres; every_run: TRUE for all runs, not the current ones alone. Example: FROM accuracy.metrics([''camera'', ''depth''], edges := [0, 5, 10, 20, 40]).';
