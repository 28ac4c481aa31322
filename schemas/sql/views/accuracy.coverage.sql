-- Do the stated intervals hold the truth as often as they say?
CREATE OR REPLACE VIEW accuracy.coverage AS
WITH either AS (
    SELECT method, 'depth' AS quantity, depth_error_m AS error_m, depth_std_m AS std_m
    FROM accuracy.errors
    UNION ALL
    SELECT method, 'height', height_error_m, height_std_m
    FROM accuracy.errors
),
grouped AS (
    SELECT method, quantity, accuracy.interval_metrics(error_m, std_m) AS intervals
    FROM either
    GROUP BY ALL
)
SELECT method, quantity, unnest(intervals) FROM grouped WHERE intervals.n > 0 ORDER BY ALL;
COMMENT ON VIEW accuracy.coverage IS 'Do the stated intervals hold the truth as often as they say? Shares of errors inside nominal 50, 80 and 95 % intervals.';
