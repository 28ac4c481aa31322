-- Table 15: how do these estimates compare with published work?
-- Published rows as the paper prints them; it states no unit of its RMSE, so those figures stand
-- apart from ours.
CREATE OR REPLACE VIEW paper.comparison AS
WITH published AS (
    FROM (VALUES
        ('Chen et al. 2016', 'plenoptic camera, micro lens array', 'disparity by SSD',
            NULL, NULL, NULL, NULL, 0.999),
        ('Sanchez-Ferreira, Farias et al. 2016', 'parallel stereo, two identical cameras',
            'triangulation', 0.279, 0.813, NULL, 0.667, NULL),
        ('Pertuz et al. 2018, Palmieri et al. 2019', 'main lens and micro lens array',
            'light-field refocusing', 0.2, 1.6, NULL, NULL, 0.99),
        ('the paper, Nikon D5300', '50 mm prime lens, tripod', 'Eq. 16, k by aperture',
            0.5, 1.1, NULL, 0.0413, 0.99213),
        ('the paper, Canon', '50 mm prime lens, tripod', 'Eq. 16, k by aperture',
            0.5, 1.1, NULL, 0.056232, 0.971356),
        ('the paper, Tables 3-7 re-computed', '50 mm prime lens, tripod',
            'Eq. 16, k by aperture: printed estimates, 34 consistent rows',
            0.5, 1.1, 0.0323, NULL, 0.9904)
    ) AS rows(
        work, setup, technique, depth_min_m, depth_max_m, depth_rmse_m, rmse_printed, depth_r
    )
),
ours AS (
    SELECT
        camera, class_name, method,
        min(true_depth_m) AS depth_min_m, max(true_depth_m) AS depth_max_m,
        sqrt(avg(depth_error_m ** 2)) AS depth_rmse_m,
        stats.known(corr(depth_m, true_depth_m)) AS depth_r,
        count(*) AS depth_count
    FROM accuracy.errors
    WHERE depth_error_m IS NOT NULL
    GROUP BY ALL
)
SELECT
    'this database' AS work, camera AS setup,
    concat('method ', method, ', class ', coalesce(class_name, 'unknown')) AS technique,
    depth_min_m, depth_max_m, depth_count, depth_rmse_m, NULL::DOUBLE AS rmse_printed, depth_r
FROM ours
UNION ALL BY NAME
SELECT
    work, setup, technique, depth_min_m::DOUBLE AS depth_min_m,
    depth_max_m::DOUBLE AS depth_max_m, depth_rmse_m::DOUBLE AS depth_rmse_m,
    rmse_printed::DOUBLE AS rmse_printed, depth_r::DOUBLE AS depth_r
FROM published;

COMMENT ON VIEW paper.comparison IS 'Table 15: how do these estimates compare with published work? Current runs by camera, class and method, then the paper''s reference rows.';
