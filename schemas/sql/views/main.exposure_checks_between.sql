-- Does the brightness of some pictures agree with their exposure data?
--   FROM main.exposure_checks_between('a recording_id', 'a camera', 0, 1000)
-- main.exposure_checks is this for all. A day is asked by stretches, as a window over it does not
-- fit into little memory: five frames at either end of one know too few neighbours, and the scatter
-- of the camera has to be told.
--
-- By Eq. 15 a picture's luminance over t ISO / N^2 is the scene's; of a fixed camera it changes
-- slowly. A picture that leaves its neighbours' level by more than its camera's scatter has wrong
-- exposure data, or a gain that they do not tell; where the level itself changes from one picture
-- to the next and stays, gain, light or data have changed. Clipped pictures tell too little of the
-- light, and are not asked.
CREATE OR REPLACE MACRO main.exposure_checks_between(
    recording, of_camera, first_frame, last_frame, scatter := NULL
) AS TABLE
WITH lit AS (
    SELECT
        recording_id, camera, frame_index, capture_time_ns, f_number, exposure_time_s, iso_speed,
        gain_db, luminance, clipped_fraction,
        coalesce(clipped_fraction > 0.05, false) AS is_clipped,
        -- A gain of 6.02 dB is a stop. What a camera never tells counts as constant.
        CASE WHEN luminance > 0 AND exposure_time_s > 0 THEN
            log2(luminance) - log2(exposure_time_s)
            - coalesce(log2(iso_speed / 100.0), gain_db / 6.0206, 0.0)
            + 2 * coalesce(log2(f_number), 0.0)
        END AS scene_ev
    FROM main.frames
    WHERE decoded
        AND (recording IS NULL OR recording_id = recording)
        AND (of_camera IS NULL OR camera = of_camera)
        AND (first_frame IS NULL OR frame_index BETWEEN first_frame AND last_frame)
),
levels AS (
    SELECT
        *,
        CASE WHEN NOT is_clipped THEN scene_ev END AS asked_ev,
        median(asked_ev) OVER before AS before_ev,
        median(asked_ev) OVER after AS after_ev,
        median(asked_ev) OVER around AS around_ev,
        count(asked_ev) OVER before AS before_count,
        count(asked_ev) OVER after AS after_count,
        count(asked_ev) OVER around AS around_count
    FROM lit
    WINDOW
        before AS (
            PARTITION BY recording_id, camera ORDER BY frame_index
            ROWS BETWEEN 5 PRECEDING AND 1 PRECEDING
        ),
        after AS (
            PARTITION BY recording_id, camera ORDER BY frame_index
            ROWS BETWEEN CURRENT ROW AND 4 FOLLOWING
        ),
        around AS (
            PARTITION BY recording_id, camera ORDER BY frame_index
            ROWS BETWEEN 5 PRECEDING AND 5 FOLLOWING EXCLUDE CURRENT ROW
        )
),
departures AS (
    SELECT
        *,
        CASE WHEN around_count >= 4 THEN asked_ev - around_ev END AS departure_ev,
        CASE WHEN before_count >= 3 AND after_count >= 3 THEN after_ev - before_ev END AS step_ev
    FROM levels
),
scattered AS (
    -- The scatter of a camera: 1.4826 turns a median absolute deviation into a standard deviation.
    SELECT
        *,
        coalesce(
            scatter,
            1.4826 * median(abs(departure_ev)) OVER (PARTITION BY recording_id, camera)
        ) AS scatter_ev
    FROM departures
),
limited AS (
    -- f-number, time and ISO are each rounded to a third of a stop: half a stop is no rounding.
    SELECT *, greatest(0.5, 4 * coalesce(scatter_ev, 0.0)) AS limit_ev FROM scattered
),
stepped AS (
    SELECT
        *,
        abs(step_ev) > limit_ev AND abs(asked_ev - before_ev) > limit_ev AS after_step
    FROM limited
)
SELECT
    recording_id, camera, frame_index, capture_time_ns, f_number, exposure_time_s, iso_speed,
    luminance, clipped_fraction, scene_ev, departure_ev, step_ev, scatter_ev,
    CASE
        WHEN scene_ev IS NULL THEN NULL
        WHEN is_clipped THEN 'clipped'
        -- The frames after it see the step as well.
        WHEN after_step AND NOT coalesce(lag(after_step) OVER (
            PARTITION BY recording_id, camera ORDER BY frame_index
        ), false) THEN 'steps'
        WHEN abs(departure_ev) > limit_ev AND abs(asked_ev - before_ev) > limit_ev
            AND abs(asked_ev - after_ev) > limit_ev THEN 'departs'
        ELSE 'agrees'
    END AS verdict
FROM stepped;

COMMENT ON MACRO TABLE main.exposure_checks_between IS 'Does the brightness of some pictures agree with their exposure data? recording, of_camera, first_frame, last_frame: which, NULL for all; scatter: the camera''s scatter_ev, if it is not to be taken from these. As main.exposure_checks; frames at the ends know fewer neighbours.';
