-- How well are objects found and followed, by each camera?
CREATE OR REPLACE VIEW accuracy.tracking_by_camera AS
SELECT
    camera,
    true_count, observed_count, recall, precision, hota, deta, assa, idf1, mota, switch_count,
    fragment_count
FROM accuracy.tracking_figures('all', ['camera'])
ORDER BY camera;

COMMENT ON VIEW accuracy.tracking_by_camera IS 'How well are objects found and followed, by each camera? Of the recordings that have truth with boxes, in the frames that are labelled: recall, precision, IDF1, MOTA, switches and fragments at an overlap (intersection over union) of 0.5.';
COMMENT ON COLUMN accuracy.tracking_by_camera.true_count IS 'Number of true boxes.';
COMMENT ON COLUMN accuracy.tracking_by_camera.recall IS 'Share of the true boxes that were found.';
COMMENT ON COLUMN accuracy.tracking_by_camera.precision IS 'Share of the boxes found that are true.';
COMMENT ON COLUMN accuracy.tracking_by_camera.hota IS 'Higher order tracking accuracy (Luiten et al. 2021), the mean over overlaps of 0.05 to 0.95.';
COMMENT ON COLUMN accuracy.tracking_by_camera.deta IS 'Detection accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking_by_camera.assa IS 'Association accuracy, a factor of HOTA.';
COMMENT ON COLUMN accuracy.tracking_by_camera.idf1 IS 'Share of boxes with the right identity throughout (Ristani et al. 2016).';
COMMENT ON COLUMN accuracy.tracking_by_camera.mota IS 'One less misses, false boxes and switches for each true box (Bernardin and Stiefelhagen 2008).';
COMMENT ON COLUMN accuracy.tracking_by_camera.switch_count IS 'Number of identity switches.';
COMMENT ON COLUMN accuracy.tracking_by_camera.fragment_count IS 'Number of times that a true track is lost and found again.';
