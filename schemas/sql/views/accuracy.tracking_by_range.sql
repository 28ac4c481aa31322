-- How well are objects found and followed, at each range?
CREATE OR REPLACE VIEW accuracy.tracking_by_range AS
SELECT
    true_depth_to_m, true_depth_from_m,
    true_count, observed_count, recall, precision, hota, deta, assa, idf1, mota, switch_count,
    fragment_count
FROM accuracy.tracking_figures('range', [])
ORDER BY true_depth_from_m;

COMMENT ON VIEW accuracy.tracking_by_range IS 'How well are objects found and followed, at each range? Of the recordings that have truth with boxes, in the frames that are labelled: recall, precision, IDF1, MOTA, switches and fragments at an overlap (intersection over union) of 0.5.';
COMMENT ON COLUMN accuracy.tracking_by_range.true_count IS 'Number of true boxes.';
COMMENT ON COLUMN accuracy.tracking_by_range.recall IS 'Share of the true boxes that were found.';
COMMENT ON COLUMN accuracy.tracking_by_range.precision IS 'Share of the boxes found that are true.';
COMMENT ON COLUMN accuracy.tracking_by_range.hota IS 'Higher order tracking accuracy (Luiten et al. 2021), the mean over overlaps of 0.05 to 0.95.';
COMMENT ON COLUMN accuracy.tracking_by_range.deta IS 'Detection accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking_by_range.assa IS 'Association accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking_by_range.idf1 IS 'Share of boxes with the right identity throughout (Ristani et al. 2016).';
COMMENT ON COLUMN accuracy.tracking_by_range.mota IS 'One less misses, false boxes and switches for each true box (Bernardin and Stiefelhagen 2008).';
COMMENT ON COLUMN accuracy.tracking_by_range.switch_count IS 'Number of identity switches.';
COMMENT ON COLUMN accuracy.tracking_by_range.fragment_count IS 'Number of times that a true track is lost and found again.';
