-- How much of the truth was found, and by which rule was it matched?
CREATE OR REPLACE VIEW accuracy.matching AS
WITH truth AS (
    SELECT recording_id, camera, count(*) AS truth_count
    FROM main.ground_truth
    ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index)
    GROUP BY ALL
),
observed AS (
    SELECT recording_id, camera, count(*) AS observation_count
    FROM main.observations
    ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index)
    GROUP BY ALL
),
matched AS (
    SELECT
        recording_id, camera,
        count(*) FILTER (rule = 'object_id') AS by_object_id_count,
        count(*) FILTER (rule = 'overlap') AS by_overlap_count,
        avg(overlap) AS mean_overlap
    FROM main.matches
    ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index)
    GROUP BY ALL
)
SELECT
    recording_id, recordings.file_name, camera, truth_count,
    coalesce(observation_count, 0) AS observation_count,
    coalesce(by_object_id_count, 0) AS by_object_id_count,
    coalesce(by_overlap_count, 0) AS by_overlap_count,
    (coalesce(by_object_id_count, 0) + coalesce(by_overlap_count, 0)) / truth_count
        AS found_share,
    (by_object_id_count + by_overlap_count) / observation_count AS true_share,
    mean_overlap
FROM truth
LEFT JOIN observed USING (recording_id, camera)
LEFT JOIN matched USING (recording_id, camera)
LEFT JOIN main.recordings USING (recording_id)
ORDER BY file_name, recording_id, camera;

COMMENT ON VIEW accuracy.matching IS 'How much of the truth was found, and by which rule was it matched? By object_id, where the recording''s truth for that camera knows the observation''s object_id; else by overlap: intersection over union of the boxes at least 0.5, each being the other''s best.';
COMMENT ON COLUMN accuracy.matching.truth_count IS 'True objects, one a frame.';
COMMENT ON COLUMN accuracy.matching.observation_count IS 'Observations of the camera.';
COMMENT ON COLUMN accuracy.matching.by_object_id_count IS 'True objects matched by their id.';
COMMENT ON COLUMN accuracy.matching.by_overlap_count IS 'True objects matched by the overlap of the boxes.';
COMMENT ON COLUMN accuracy.matching.found_share IS 'Share of the true objects that an observation was matched with (recall).';
COMMENT ON COLUMN accuracy.matching.true_share IS 'Share of the observations that were matched (precision, where the truth is complete).';
COMMENT ON COLUMN accuracy.matching.mean_overlap IS 'Mean intersection over union of the matched boxes.';
