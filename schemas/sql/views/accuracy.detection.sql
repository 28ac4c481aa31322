-- How many of the true boxes were found, and how many of the boxes found are true, at any overlap?
CREATE OR REPLACE VIEW accuracy.detection AS
SELECT
    recording_id, recordings.file_name, camera, overlap, true_count, observed_count, matched_count,
    matched_count / nullif(true_count, 0) AS recall,
    matched_count / nullif(observed_count, 0) AS precision,
    overlap_sum / nullif(matched_count, 0) AS mean_overlap
FROM main.tracking_accuracy
LEFT JOIN main.recordings USING (recording_id)
WHERE grouping = 'all'
ORDER BY file_name, recording_id, camera, overlap;

COMMENT ON VIEW accuracy.detection IS 'How many of the true boxes were found, and how many of the boxes found are true, at any overlap? One row for each recording, camera and least intersection over union, 0.05 to 0.95, by the assignment of HOTA.';
COMMENT ON COLUMN accuracy.detection.recall IS 'Share of the true boxes that were found.';
COMMENT ON COLUMN accuracy.detection.precision IS 'Share of the boxes found that are true.';
COMMENT ON COLUMN accuracy.detection.mean_overlap IS 'Mean overlap of the matched boxes.';
