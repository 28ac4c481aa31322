-- How good are boxes and tracks, over any groups of recordings, cameras, classes or ranges?
-- HOTA: Luiten et al. 2021, Eqs. 8-12. Sums are taken before ratios, as TrackEval does.
CREATE OR REPLACE MACRO accuracy.tracking_figures(one_grouping, dimensions) AS TABLE
WITH grouped AS (
    SELECT
        overlap,
        CASE WHEN list_contains(dimensions, 'recording') THEN recording_id END AS recording_id,
        CASE WHEN list_contains(dimensions, 'camera') THEN camera END AS camera,
        class_name, true_depth_from_m, true_depth_to_m,
        sum(true_count) AS true_count, sum(observed_count) AS observed_count,
        sum(matched_count) AS matched_count, sum(association_sum) AS association_sum,
        sum(overlap_sum) AS overlap_sum, sum(clear_matched_count) AS clear_matched_count,
        sum(switch_count) AS switch_count, sum(fragment_count) AS fragment_count,
        sum(identity_matched_count) AS identity_matched_count
    FROM main.tracking_accuracy
    WHERE grouping = one_grouping
    GROUP BY ALL
),
ratios AS (
    SELECT
        *,
        matched_count / greatest(true_count + observed_count - matched_count, 1) AS deta,
        association_sum / greatest(matched_count, 1) AS assa
    FROM grouped
)
SELECT
    recording_id, camera, class_name, true_depth_from_m, true_depth_to_m,
    max(true_count) AS true_count, max(observed_count) AS observed_count,
    max(clear_matched_count) / nullif(max(true_count), 0) AS recall,
    max(clear_matched_count) / nullif(max(observed_count), 0) AS precision,
    avg(sqrt(deta * assa)) AS hota, avg(deta) AS deta, avg(assa) AS assa,
    2 * max(identity_matched_count) / nullif(max(true_count) + max(observed_count), 0)
        AS idf1,
    1 - (
        max(true_count) + max(observed_count) - 2 * max(clear_matched_count)
        + max(switch_count)
    ) / nullif(max(true_count), 0) AS mota,
    max(switch_count) AS switch_count, max(fragment_count) AS fragment_count
FROM ratios
GROUP BY ALL;

COMMENT ON MACRO TABLE accuracy.tracking_figures IS 'How good are boxes and tracks, over any groups? one_grouping: all, class or range; dimensions: some of recording, camera. Recall, precision, IDF1, MOTA, switches and fragments at an overlap of 0.5.';
