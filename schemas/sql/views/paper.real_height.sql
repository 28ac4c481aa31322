-- Tables 9-10: how tall is each object by Eq. 14, and by the exact magnification?
-- Eq. 14 takes the image at the focal length (Eq. 12); a lens focused on the object has it farther
-- back, magnification f / (depth - f), which makes the object smaller.
CREATE OR REPLACE VIEW paper.real_height AS
WITH computed AS (
    SELECT
        measurements.*, estimates.method, estimates.depth_m, estimates.height_m,
        object_height_mm / focal_length_mm * estimates.depth_m AS height_eq14_m,
        object_height_mm / focal_length_mm * (estimates.depth_m - focal_length_mm / 1000)
            AS height_exact_m
    FROM paper.measurements
    JOIN main.estimates USING (recording_id, observation_index)
    JOIN main.current_run USING (recording_id, run_id)
)
SELECT
    file_name, recording_id, camera, class_name, object_id, method, f_number,
    count(*) AS observation_count,
    avg(object_height_px) AS object_height_px, avg(object_height_mm) AS object_height_mm,
    avg(depth_m) AS depth_m, true_height_m,
    avg(height_eq14_m) AS height_eq14_m, avg(height_exact_m) AS height_exact_m,
    avg(height_m) AS height_m,
    avg(height_eq14_m) - true_height_m AS height_eq14_error_m,
    avg(height_exact_m) - true_height_m AS height_exact_error_m
FROM computed
WHERE height_eq14_m - true_height_m IS NOT NULL
GROUP BY
    file_name, recording_id, camera, class_name, object_id, method, f_number, true_height_m,
    round(true_depth_m, 3)
ORDER BY camera, class_name, method, f_number, file_name, object_id;

COMMENT ON VIEW paper.real_height IS 'Tables 9-10: how tall is each object by Eq. 14, and by the exact magnification f / (depth - f)? With the depth that each method estimated; one row for each object, true depth (to the millimetre) and aperture; current runs.';
COMMENT ON COLUMN paper.real_height.observation_count IS 'Observations that were averaged.';
COMMENT ON COLUMN paper.real_height.height_m IS 'The height that the current run estimated, by its own rule.';
