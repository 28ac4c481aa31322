-- Table 8: which k does the truth imply at each aperture, beside the k that the paper prints?
-- Eq. 16 with the lens focused at infinity, solved for k; a_R is in mm where the paper's other
-- lengths are in cm, hence the 10: k = depth O_s / (10 a_R f).
CREATE OR REPLACE VIEW paper.k_by_aperture AS
WITH implied AS (
    SELECT
        *, true_depth_m * 1000 * object_width_mm / (10 * aperture_radius_mm * focal_length_mm) AS k
    FROM paper.measurements
    WHERE true_depth_m * object_width_mm * aperture_radius_mm > 0
),
grouped AS (
    SELECT
        camera, class_name, f_number, count(*) AS observation_count,
        avg(k) AS k_mean, stddev_samp(k) AS k_std,
        stddev_samp(k) / sqrt(count(*)) AS k_std_error,
        avg(10 * k * aperture_radius_mm) AS equivalent_object_size_mm,
        min(true_depth_m) AS depth_min_m, max(true_depth_m) AS depth_max_m
    FROM implied
    GROUP BY ALL
)
SELECT
    grouped.*, table_8.k_printed::DOUBLE AS k_printed,
    100 * (k_mean / table_8.k_printed::DOUBLE - 1) AS k_difference_percent
FROM grouped
LEFT JOIN paper.table_8 ON abs(table_8.f_number::DOUBLE - grouped.f_number) < 0.005
ORDER BY camera, class_name, grouped.f_number;

COMMENT ON VIEW paper.k_by_aperture IS 'Table 8: which k does the truth imply at each aperture, beside the k that the paper prints? By the width of the object; k belongs to the camera and the class of objects (it is an object size in disguise).';
