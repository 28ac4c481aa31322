-- Which observation is which true object?
-- By object_id where both have it; else by overlap: intersection over union at least 0.5, each being
-- the other's best. What is matched by its id takes no part in matching by overlap.
CREATE OR REPLACE VIEW accuracy.match_candidates AS
WITH paired AS (
    SELECT
        recording_id, camera, frame_index, o.observation_index, t.object_id,
        o.object_id = t.object_id AS same_id,
        greatest(0, least(o.x_max_px, t.x_max_px) - greatest(o.x_min_px, t.x_min_px))
            * greatest(0, least(o.y_max_px, t.y_max_px) - greatest(o.y_min_px, t.y_min_px))
            AS shared_px2,
        (o.x_max_px - o.x_min_px) * (o.y_max_px - o.y_min_px) AS observed_px2,
        (t.x_max_px - t.x_min_px) * (t.y_max_px - t.y_min_px) AS true_px2
    FROM observations o
    JOIN ground_truth t USING (recording_id, camera, frame_index)
),
measured AS (
    SELECT *, shared_px2 / (observed_px2 + true_px2 - shared_px2) AS overlap FROM paired
),
by_id AS (
    SELECT * FROM measured WHERE same_id
),
by_overlap AS (
    SELECT * FROM measured
    ANTI JOIN by_id USING (recording_id, observation_index)
    WHERE overlap >= 0.5
        AND (recording_id, camera, frame_index, object_id) NOT IN (
            SELECT (recording_id, camera, frame_index, object_id) FROM by_id
        )
    QUALIFY overlap = max(overlap) OVER (PARTITION BY recording_id, observation_index)
        AND overlap = max(overlap) OVER (PARTITION BY recording_id, camera, frame_index, object_id)
)
SELECT recording_id, camera, frame_index, observation_index, object_id, 'object_id' AS rule, overlap
FROM by_id
UNION ALL
SELECT recording_id, camera, frame_index, observation_index, object_id, 'overlap', overlap
FROM by_overlap;
COMMENT ON VIEW accuracy.match_candidates IS 'Which observation is which true object? By object_id where both have it, else by overlap (intersection over union at least 0.5, each the other''s best). Stored in the table matches when a recording is read.';
