-- Tables 3-7: what depth does Eq. 16 give for each object size, aperture by aperture?
-- Observations of one object at one true depth (to the millimetre) and aperture are averaged.
CREATE OR REPLACE VIEW paper.depth_by_aperture AS
WITH estimated AS (
    SELECT
        measurements.*, estimates.depth_m, estimates.depth_std_m,
        CASE calibrations.dimension
            WHEN 'height' THEN object_height_px ELSE object_width_px
        END AS object_size_px,
        CASE calibrations.dimension
            WHEN 'height' THEN object_height_mm ELSE object_width_mm
        END AS object_size_mm
    FROM paper.measurements
    JOIN main.estimates USING (recording_id, observation_index)
    JOIN main.current_run USING (recording_id, run_id)
    LEFT JOIN (
        SELECT DISTINCT calibration_id, run_id, dimension FROM main.calibrations
    ) AS calibrations USING (calibration_id, run_id)
    WHERE estimates.method = 'aperture'
        AND estimates.depth_m - measurements.true_depth_m IS NOT NULL
)
SELECT
    file_name, recording_id, camera, class_name, object_id, f_number,
    avg(aperture_radius_mm) AS aperture_radius_mm,
    avg(depth_m * 1000 * object_size_mm / (10 * aperture_radius_mm * focal_length_mm)) AS k,
    avg(object_size_px) AS object_size_px, avg(object_size_mm) AS object_size_mm,
    count(*) AS observation_count,
    avg(depth_m) AS depth_m, avg(depth_std_m) AS depth_std_m,
    round(true_depth_m, 3) AS true_depth_m,
    avg(depth_m - estimated.true_depth_m) AS depth_error_m
FROM estimated
GROUP BY
    file_name, recording_id, camera, class_name, object_id, f_number,
    round(estimated.true_depth_m, 3)
ORDER BY camera, class_name, f_number, true_depth_m, file_name, object_id;

COMMENT ON VIEW paper.depth_by_aperture IS 'Tables 3-7: what depth does Eq. 16 give for each object size, aperture by aperture? One row for each object, true depth (to the millimetre) and aperture; current runs.';
COMMENT ON COLUMN paper.depth_by_aperture.k IS 'k that the estimate stands for: depth O_s / (10 a_R f).';
COMMENT ON COLUMN paper.depth_by_aperture.object_size_px IS 'O_s in pixels: the side of the box that the calibration uses.';
COMMENT ON COLUMN paper.depth_by_aperture.object_size_mm IS 'O_s: that side on the sensor.';
COMMENT ON COLUMN paper.depth_by_aperture.observation_count IS 'Observations that were averaged.';
COMMENT ON COLUMN paper.depth_by_aperture.depth_std_m IS 'Mean standard deviation of one estimate.';
