-- Does exposure explain any of the depth error that remains after the object size is calibrated?
--
-- The paper lets k depend on luminance / N^2. If depth errors went with it, their regression on its
-- logarithm would have a slope. Relative errors, so that near and far count alike.
CREATE OR REPLACE VIEW accuracy.exposure_effect AS
WITH terms AS (
    SELECT
        errors.recording_id, errors.file_name, errors.method, errors.class_name,
        100 * depth_error_m / errors.true_depth_m AS error_percent,
        log2(observations.luminance / (errors.f_number * errors.f_number)) AS exposure_ev
    FROM accuracy.errors
    JOIN main.observations USING (recording_id, observation_index)
    WHERE errors.true_depth_m > 0 AND errors.f_number > 0 AND observations.luminance > 0
),
fits AS (
    SELECT
        recording_id, file_name, method, class_name,
        count(*) AS observation_count,
        stddev_samp(exposure_ev) AS exposure_spread_ev,
        stddev_samp(error_percent) AS error_spread_percent,
        regr_slope(error_percent, exposure_ev) AS slope_percent_per_ev,
        corr(error_percent, exposure_ev) AS r,
        regr_sxx(error_percent, exposure_ev) AS sxx,
        regr_syy(error_percent, exposure_ev) AS syy,
        regr_sxy(error_percent, exposure_ev) AS sxy
    FROM terms
    GROUP BY recording_id, file_name, method, class_name
    HAVING count(*) >= 5 AND max(exposure_ev) > min(exposure_ev)
)
SELECT
    file_name, method, class_name, observation_count, exposure_spread_ev, error_spread_percent,
    slope_percent_per_ev,
    sqrt(greatest(syy - sxy * sxy / sxx, 0.0) / (observation_count - 2) / sxx)
        AS slope_std_error_percent,
    slope_percent_per_ev / nullif(slope_std_error_percent, 0.0) AS t,
    r * r AS r2,
    1 - (1 - r * r) * (observation_count - 1) / (observation_count - 2) AS adjusted_r2,
    recording_id
FROM fits
ORDER BY file_name, class_name, method;

COMMENT ON VIEW accuracy.exposure_effect IS 'Does exposure explain any of the depth error that remains after the object size is calibrated? Relative depth errors of each recording, method and class over log2(luminance / N^2), the ratio on which the paper''s k depends. An |t| below 2 is chance.';
COMMENT ON COLUMN accuracy.exposure_effect.exposure_spread_ev IS 'Standard deviation of log2(luminance / N^2), in stops.';
COMMENT ON COLUMN accuracy.exposure_effect.error_spread_percent IS 'Standard deviation of the relative depth errors.';
COMMENT ON COLUMN accuracy.exposure_effect.slope_percent_per_ev IS 'By how much the error changes with each stop of exposure.';
COMMENT ON COLUMN accuracy.exposure_effect.slope_std_error_percent IS 'Its standard error; observations taken as independent.';
COMMENT ON COLUMN accuracy.exposure_effect.t IS 'Slope over its standard error.';
COMMENT ON COLUMN accuracy.exposure_effect.r2 IS 'Share of the errors'' variance that exposure explains.';
COMMENT ON COLUMN accuracy.exposure_effect.adjusted_r2 IS 'The same less what as many random numbers would explain; zero or below is nothing.';
