-- Functions for the views: distributions that DuckDB lacks, each a series or continued fraction
-- evaluated from its last term backwards (no loop, no extension). Tests hold them against scipy.

CREATE SCHEMA IF NOT EXISTS stats;
CREATE SCHEMA IF NOT EXISTS accuracy;
CREATE SCHEMA IF NOT EXISTS paper;

-- Half widths of the middle 50, 80 and 95 % of a normal distribution, in standard deviations.
CREATE OR REPLACE MACRO stats.normal_50() AS 0.6744897501960817::DOUBLE;
CREATE OR REPLACE MACRO stats.normal_80() AS 1.2815515655446004::DOUBLE;
CREATE OR REPLACE MACRO stats.normal_95() AS 1.959963984540054::DOUBLE;

-- Unknown stays NULL: what 0 / 0 or an overflow left behind is not a number to report.
CREATE OR REPLACE MACRO stats.known(x) AS CASE WHEN isfinite(x) THEN x END;

-- Whether a variance is more than what rounding leaves of the sums of equal numbers (some 1e-16 of
-- their mean, squared): distances are known to no more than ten digits.
CREATE OR REPLACE MACRO stats.varies(variance, mean) AS variance > (1e-12 * mean) ** 2;

-- The mean of doubles; three times as fast as avg() over ten million rows.
CREATE OR REPLACE MACRO stats.mean(x) AS sum(x) / count(x);

-- erfc for x >= 2.5, without the cancellation of 1 - erf(x).
CREATE OR REPLACE MACRO stats.erfc_tail(x) AS
    exp(-x * x) / sqrt(pi())
    / list_reduce(range(80, 0, -1), lambda tail, n: x + n / 2 / tail, x::DOUBLE);

-- 2/sqrt(pi) x exp(-x^2) sum 2^n x^2n / (2n+1)!! below 2.5; 1 - the continued fraction above.
CREATE OR REPLACE MACRO stats.erf(x) AS
    CASE
        WHEN abs(x) < 2.5 THEN
            2 / sqrt(pi()) * x * exp(-x * x) * list_reduce(
                range(60, 0, -1), lambda tail, n: 1 + 2 * x * x / (2 * n + 1) * tail, 1.0::DOUBLE
            )
        ELSE sign(x) * (1 - stats.erfc_tail(abs(x)))
    END;

-- Cumulative normal distribution.
CREATE OR REPLACE MACRO stats.normal_cdf(z) AS (1 + stats.erf(z / sqrt(2::DOUBLE))) / 2;

-- Continued fraction of the incomplete beta function. 500 terms reach double precision for a and b
-- to about 50 000 (100 000 degrees of freedom); beyond that the normal limit is as good.
CREATE OR REPLACE MACRO stats.beta_fraction(x, a, b) AS
    1 / list_reduce(
        range(500, 0, -1),
        lambda tail, n: 1 + x / tail * CASE
            WHEN n % 2 = 0 THEN (n // 2) * (b - n // 2) / ((a + n - 1) * (a + n))
            ELSE -(a + n // 2) * (a + b + n // 2) / ((a + n - 1) * (a + n))
        END,
        1.0::DOUBLE
    );

-- x^a (1-x)^b / B(a, b), the factor before the fraction; y is 1 - x, given apart to keep its digits.
CREATE OR REPLACE MACRO stats.beta_factor(x, y, a, b) AS
    exp(a * ln(x) + b * ln(y) + lgamma(a + b) - lgamma(a) - lgamma(b));

-- Regularised incomplete beta function I_x(a, b), x + y = 1.
CREATE OR REPLACE MACRO stats.beta_regularised(x, y, a, b) AS
    CASE
        WHEN x <= 0 THEN 0.0::DOUBLE
        WHEN y <= 0 THEN 1.0::DOUBLE
        WHEN x < (a + 1) / (a + b + 2) THEN
            stats.beta_factor(x, y, a, b) / a * stats.beta_fraction(x, a, b)
        ELSE 1 - stats.beta_factor(x, y, a, b) / b * stats.beta_fraction(y, b, a)
    END;

-- Two-sided significance of Student's t with `df` degrees of freedom.
CREATE OR REPLACE MACRO stats.student_p(t, df) AS
    CASE
        WHEN df > 0 THEN stats.beta_regularised(
            (df / (df + t * t))::DOUBLE, (t * t / (df + t * t))::DOUBLE,
            (df / 2)::DOUBLE, 0.5::DOUBLE
        )
    END;

-- Significance of F with df1 and df2 degrees of freedom.
CREATE OR REPLACE MACRO stats.f_p(f, df1, df2) AS
    CASE
        WHEN df1 > 0 AND df2 > 0 THEN stats.beta_regularised(
            (df2 / (df2 + df1 * f))::DOUBLE, (df1 * f / (df2 + df1 * f))::DOUBLE,
            (df2 / 2)::DOUBLE, (df1 / 2)::DOUBLE
        )
    END;

-- Student's t that holds the middle 95 %: the Cornish-Fisher expansion (Abramowitz and Stegun,
-- 26.7.5), refined by Newton's method where few degrees of freedom make it coarse.
CREATE OR REPLACE MACRO stats.student_95_expansion(z, df) AS
    z + (z ** 3 + z) / 4 / df
    + (5 * z ** 5 + 16 * z ** 3 + 3 * z) / 96 / df ** 2
    + (3 * z ** 7 + 19 * z ** 5 + 17 * z ** 3 - 15 * z) / 384 / df ** 3
    + (79 * z ** 9 + 776 * z ** 7 + 1482 * z ** 5 - 1920 * z ** 3 - 945 * z) / 92160 / df ** 4;

CREATE OR REPLACE MACRO stats.student_density(t, df) AS
    exp(
        lgamma((df + 1) / 2) - lgamma(df / 2) - ln(df * pi()) / 2
        - (df + 1) / 2 * ln(1 + t * t / df)
    );

CREATE OR REPLACE MACRO stats.student_95(df) AS
    CASE
        WHEN df < 1 THEN NULL
        WHEN df > 200 THEN stats.student_95_expansion(stats.normal_95(), df::DOUBLE)
        ELSE list_reduce(
            range(6),
            lambda t, step: t + (stats.student_p(t, df) - 0.05) / 2
                / stats.student_density(t, df),
            stats.student_95_expansion(stats.normal_95(), df::DOUBLE)
        )
    END;

-- 95 % interval of a correlation of n independent pairs (Fisher's z).
CREATE OR REPLACE MACRO stats.fisher_low(r, n) AS
    CASE WHEN n > 3 AND abs(r) < 1 THEN tanh(atanh(r) - stats.normal_95() / sqrt(n - 3)) END;
CREATE OR REPLACE MACRO stats.fisher_high(r, n) AS
    CASE WHEN n > 3 AND abs(r) < 1 THEN tanh(atanh(r) + stats.normal_95() / sqrt(n - 3)) END;

-- The dimensions, as accuracy.metrics takes them, by which a column tells estimates apart; NULL for
-- a column that is no dimension's. A new dimension is a line here, and its column in accuracy.sums
-- and accuracy.from_sums.
CREATE OR REPLACE MACRO accuracy.dimensions_of(column_name) AS CASE column_name
    WHEN 'run_id' THEN ['run']
    WHEN 'run_label' THEN ['run']
    WHEN 'recording_id' THEN ['recording', 'track']
    WHEN 'file_name' THEN ['recording', 'track']
    WHEN 'camera' THEN ['camera', 'track']
    WHEN 'class_name' THEN ['class']
    WHEN 'track_id' THEN ['track']
    WHEN 'f_number' THEN ['aperture']
    WHEN 'true_depth_from_m' THEN ['depth']
    WHEN 'true_depth_to_m' THEN ['depth']
END;

-- A value of a column, or NULL where none of its dimensions is asked for, so that rows fall together.
CREATE OR REPLACE MACRO accuracy.if_asked(dimensions, column_name, value) AS CASE
    WHEN list_has_any(dimensions, accuracy.dimensions_of(column_name)) THEN value
END;

-- A length with its deviation and its 95 % interval.
CREATE OR REPLACE MACRO stats.with_interval(value_m, variance_m2) AS {
    'value_m': value_m,
    'std_m': sqrt(variance_m2),
    'low_m': value_m - stats.normal_95() * sqrt(variance_m2),
    'high_m': value_m + stats.normal_95() * sqrt(variance_m2)
};

-- Variance of the difference of two heights, rows of track_heights or people. What one camera's tracks
-- share cancels: |a - b|^2 over the loadings, and what is each track's own. Without loadings (a surveyed
-- pose, or tracks of two recordings) they are taken as independent. The doubt that a track is no one person
-- is not in it: it is a probability of its own (doubt_share).
CREATE OR REPLACE MACRO stats.difference_variance(a, b) AS
    CASE
        WHEN a.recording_id = b.recording_id AND a.camera = b.camera
            AND a.common_loadings_m IS NOT NULL AND b.common_loadings_m IS NOT NULL
        THEN array_distance(a.common_loadings_m, b.common_loadings_m) ** 2
            + a.own_std_m ** 2 + b.own_std_m ** 2
        ELSE a.height_std_m ** 2 + b.height_std_m ** 2
    END;

-- How much taller is one than another? Two rows of people; a struct of value_m, std_m, low_m, high_m.
CREATE OR REPLACE MACRO height_difference(a, b) AS
    stats.with_interval(a.height_m - b.height_m, stats.difference_variance(a, b));

-- How likely is one taller than another? Two rows of people.
CREATE OR REPLACE MACRO taller(a, b) AS
    stats.normal_cdf((a.height_m - b.height_m) / nullif(sqrt(stats.difference_variance(a, b)), 0));

-- Derivatives of a place (x right, y ahead) on the ground by the camera's tilt and roll, h its height:
-- from Z = h / (y_f cos t + sin t), x = x_f Z, y = Z (cos t - y_f sin t).
CREATE OR REPLACE MACRO stats.place_by_tilt(p) AS
    [-p.x_m * p.y_m / p.camera_height_m, -(p.camera_height_m ** 2 + p.y_m ** 2) / p.camera_height_m];
CREATE OR REPLACE MACRO stats.place_by_roll(p) AS [
    -(p.camera_height_m * cos(p.tilt_rad) - p.y_m * sin(p.tilt_rad))
    - p.x_m ** 2 * cos(p.tilt_rad) / p.camera_height_m,
    -p.x_m * p.y_m * cos(p.tilt_rad) / p.camera_height_m - p.x_m * sin(p.tilt_rad)
];
CREATE OR REPLACE MACRO stats.apart_m(a, b) AS sqrt((a.x_m - b.x_m) ** 2 + (a.y_m - b.y_m) ** 2);
-- By how much the distance of two places grows with what moves them: along the line between them.
CREATE OR REPLACE MACRO stats.apart_by(a, b, move_a, move_b) AS
    ((a.x_m - b.x_m) * (move_a[1] - move_b[1]) + (a.y_m - b.y_m) * (move_a[2] - move_b[2]))
    / nullif(stats.apart_m(a, b), 0);
-- The part of a depth's relative variance that is the pose's: d log Z by log h is 1, by tilt -y / h, by
-- roll -x cos t / h.
CREATE OR REPLACE MACRO stats.pose_variance(p) AS
    list_sum(list_transform(range(1, 7), lambda k: (
        p.pose_loadings[k] - p.y_m / p.camera_height_m * p.pose_loadings[6 + k]
        - p.x_m * cos(p.tilt_rad) / p.camera_height_m * p.pose_loadings[12 + k]
    ) ** 2));
-- What is a place's own moves it along the line of sight by as much as its depth.
CREATE OR REPLACE MACRO stats.own_apart_variance(a, b, p) AS
    greatest((p.depth_std_m / p.depth_m) ** 2 - coalesce(stats.pose_variance(p), 0), 0)
    * (((a.x_m - b.x_m) * p.x_m + (a.y_m - b.y_m) * p.y_m) / nullif(stats.apart_m(a, b), 0)) ** 2;
-- What both places owe to the same pose: a scale moves them apart by their distance.
CREATE OR REPLACE MACRO stats.common_apart_variance(a, b) AS
    coalesce(list_sum(list_transform(range(1, 7), lambda k: (
        stats.apart_m(a, b) * a.pose_loadings[k]
        + stats.apart_by(a, b, stats.place_by_tilt(a), stats.place_by_tilt(b))
            * a.pose_loadings[6 + k]
        + stats.apart_by(a, b, stats.place_by_roll(a), stats.place_by_roll(b))
            * a.pose_loadings[12 + k]
    ) ** 2)), 0);

-- How far apart are two on the ground? Two rows of places of one camera and frame.
CREATE OR REPLACE MACRO ground_distance(a, b) AS stats.with_interval(
    stats.apart_m(a, b),
    stats.common_apart_variance(a, b)
    + stats.own_apart_variance(a, b, a) + stats.own_apart_variance(a, b, b)
);
