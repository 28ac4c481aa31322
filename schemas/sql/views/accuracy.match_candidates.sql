-- Which observation of a recording is which true object?
-- The store fills the table `matches` from this when it takes a recording in.
--
-- 1. By object_id, where the recording's truth for that camera knows the observation's object_id.
-- 2. Else by overlap: intersection over union of the boxes at least 0.5, and each the other's best.
--    An observation whose object_id means nothing to the truth (another numbering) comes here too.
-- Frames have nothing to do with each other: a day is matched by stretches of them.
-- An observation has one true object at most, a true object one observation at most a frame.
CREATE OR REPLACE MACRO accuracy.match_candidates(
    recording, first_frame := NULL, last_frame := NULL
) AS TABLE
WITH named AS (
    SELECT DISTINCT camera, object_id FROM main.ground_truth WHERE recording_id = recording
),
truth AS (
    SELECT * FROM main.ground_truth
    WHERE recording_id = recording
        AND (first_frame IS NULL OR frame_index BETWEEN first_frame AND last_frame)
),
observed AS (
    SELECT
        observations.*,
        EXISTS (
            FROM named
            WHERE named.camera = observations.camera AND named.object_id = observations.object_id
        ) AS is_known
    FROM main.observations
    WHERE recording_id = recording
        AND (first_frame IS NULL OR frame_index BETWEEN first_frame AND last_frame)
),
pairs AS (
    SELECT
        truth.camera, truth.frame_index, observed.observation_index, truth.object_id,
        observed.is_known, observed.object_id AS observed_object_id, observed.score,
        greatest(
            least(truth.x_max_px, observed.x_max_px)
                - greatest(truth.x_min_px, observed.x_min_px),
            0
        ) * greatest(
            least(truth.y_max_px, observed.y_max_px)
                - greatest(truth.y_min_px, observed.y_min_px),
            0
        ) AS common_px2,
        (truth.x_max_px - truth.x_min_px) * (truth.y_max_px - truth.y_min_px) AS true_px2,
        (observed.x_max_px - observed.x_min_px) * (observed.y_max_px - observed.y_min_px)
            AS observed_px2
    FROM truth JOIN observed USING (camera, frame_index)
    WHERE NOT observed.is_known OR observed.object_id = truth.object_id
),
measured AS (
    SELECT
        * EXCLUDE (common_px2, true_px2, observed_px2),
        -- greatest() and least() pass over NULL: a box is unknown where its area is.
        CASE
            WHEN true_px2 > 0 AND observed_px2 > 0
            THEN common_px2 / (true_px2 + observed_px2 - common_px2)
        END AS overlap
    FROM pairs
),
by_object_id AS (
    SELECT camera, frame_index, observation_index, object_id, 'object_id' AS rule, overlap
    FROM measured
    WHERE is_known
    QUALIFY row_number() OVER (
        PARTITION BY camera, frame_index, object_id
        ORDER BY overlap DESC NULLS LAST, score DESC NULLS LAST, observation_index
    ) = 1
),
by_overlap AS (
    SELECT camera, frame_index, observation_index, object_id, 'overlap' AS rule, overlap
    FROM measured ANTI JOIN by_object_id USING (camera, frame_index, object_id)
    WHERE NOT is_known AND overlap >= 0.5
    QUALIFY
        row_number() OVER (
            PARTITION BY observation_index ORDER BY overlap DESC, object_id
        ) = 1
        AND row_number() OVER (
            PARTITION BY camera, frame_index, object_id ORDER BY overlap DESC, observation_index
        ) = 1
),
matched AS (
    FROM by_object_id UNION ALL FROM by_overlap
)
SELECT
    truth.recording_id, truth.camera, truth.frame_index, matched.observation_index,
    truth.object_id, matched.rule, matched.overlap, observed.track_id,
    coalesce(truth.class_name, observed.class_name) AS class_name,
    frames.capture_time_ns, frames.f_number,
    truth.depth_m AS true_depth_m, truth.range_m AS true_range_m, truth.height_m AS true_height_m
FROM matched
JOIN truth USING (camera, frame_index, object_id)
JOIN observed USING (observation_index)
LEFT JOIN (
    FROM main.frames
    WHERE recording_id = recording
        AND (first_frame IS NULL OR frame_index BETWEEN first_frame AND last_frame)
) AS frames
    ON frames.camera = truth.camera AND frames.frame_index = truth.frame_index
ORDER BY truth.camera, truth.frame_index, matched.observation_index;

COMMENT ON MACRO TABLE accuracy.match_candidates IS 'Which observation of a recording is which true object? recording: a recording_id; first_frame, last_frame: of these frames only. By object_id where the truth of that camera knows the observation''s; else by overlap: intersection over union at least 0.5, each the other''s best.';
