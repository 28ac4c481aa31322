-- What does the regression of depth on 1 / object size give, number by number?
-- Ordinary least squares of depth = b0 + b1 / O_s (Eq. 17), O_s the width of the object on the
-- sensor; the views of Tables 11-13 take their figures from here. Observations count as
-- independent, as in the paper.
CREATE OR REPLACE VIEW paper.inverse_model AS
WITH points AS (
    SELECT camera, class_name, true_depth_m AS y, 1 / object_width_mm AS x
    FROM paper.measurements
    WHERE true_depth_m IS NOT NULL AND object_width_mm > 0
),
sums AS (
    SELECT
        camera, class_name, regr_count(y, x) AS n, avg(x) AS x_mean, avg(y) AS y_mean,
        regr_sxx(y, x) AS sxx, regr_syy(y, x) AS syy, regr_sxy(y, x) AS sxy
    FROM points
    GROUP BY ALL
    HAVING regr_count(y, x) >= 3 AND regr_sxx(y, x) > 0 AND regr_syy(y, x) > 0
),
fitted AS (
    SELECT
        *, sxy / sxx AS b1, y_mean - sxy / sxx * x_mean AS b0,
        sxy ** 2 / sxx AS regression_ss, greatest(syy - sxy ** 2 / sxx, 0) AS residual_ss,
        n - 2 AS df, residual_ss / df AS residual_ms
    FROM sums
)
SELECT
    camera, class_name, n AS observation_count, df AS residual_df,
    abs(sxy) / sqrt(sxx * syy) AS r, regression_ss / syy AS r2,
    1 - residual_ms / (syy / (n - 1)) AS adjusted_r2, sqrt(residual_ms) AS std_error_m,
    regression_ss AS regression_ss_m2, residual_ss AS residual_ss_m2, syy AS total_ss_m2,
    residual_ms AS residual_ms_m2, regression_ss / nullif(residual_ms, 0) AS f,
    b0 AS b0_m, sqrt(residual_ms * (1 / n + x_mean ** 2 / sxx)) AS b0_std_error_m,
    b1 AS b1_m_mm, sqrt(residual_ms / sxx) AS b1_std_error_m_mm,
    sxy / sqrt(sxx * syy) AS beta
FROM fitted
ORDER BY camera, class_name;

COMMENT ON VIEW paper.inverse_model IS 'What does the regression of true depth on 1 / object size (Eq. 17) give, number by number? Tables 11-13 on one line; width of the object on the sensor, by camera and class.';
