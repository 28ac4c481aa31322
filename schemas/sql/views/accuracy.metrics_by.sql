-- How good are the estimates, with the columns of the dimensions that are asked for and no others?
-- Every accuracy.by_* view is this macro with its dimensions filled in.
CREATE OR REPLACE MACRO accuracy.metrics_by(
    dimensions,
    edges := [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100],
    every_run := FALSE
) AS TABLE
SELECT COLUMNS(
    lambda name: coalesce(list_has_any(dimensions, accuracy.dimensions_of(name)), TRUE)
)
FROM accuracy.metrics(dimensions, edges := edges, every_run := every_run);

COMMENT ON MACRO TABLE accuracy.metrics_by IS 'How good are the estimates, with the columns of the dimensions that are asked for and no others? Arguments as those of accuracy.metrics.';
