-- How well are objects found and followed, in each recording?
CREATE OR REPLACE VIEW accuracy.tracking AS
SELECT
    recording_id, recordings.file_name, camera,
    true_count, observed_count, recall, precision, hota, deta, assa, idf1, mota, switch_count,
    fragment_count
FROM accuracy.tracking_figures('all', ['recording', 'camera'])
LEFT JOIN main.recordings USING (recording_id)
ORDER BY file_name, recording_id, camera;

COMMENT ON VIEW accuracy.tracking IS 'How well are objects found and followed, in each recording? Of the recordings that have truth with boxes, in the frames that are labelled: recall, precision, IDF1, MOTA, switches and fragments at an overlap (intersection over union) of 0.5.';
COMMENT ON COLUMN accuracy.tracking.true_count IS 'Number of true boxes.';
COMMENT ON COLUMN accuracy.tracking.recall IS 'Share of the true boxes that were found.';
COMMENT ON COLUMN accuracy.tracking.precision IS 'Share of the boxes found that are true.';
COMMENT ON COLUMN accuracy.tracking.hota IS 'Higher order tracking accuracy (Luiten et al. 2021), the mean over overlaps of 0.05 to 0.95.';
COMMENT ON COLUMN accuracy.tracking.deta IS 'Detection accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking.assa IS 'Association accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking.idf1 IS 'Share of boxes with the right identity throughout (Ristani et al. 2016).';
COMMENT ON COLUMN accuracy.tracking.mota IS 'One less misses, false boxes and switches for each true box (Bernardin and Stiefelhagen 2008).';
COMMENT ON COLUMN accuracy.tracking.switch_count IS 'Number of identity switches.';
COMMENT ON COLUMN accuracy.tracking.fragment_count IS 'Number of times that a true track is lost and found again.';
