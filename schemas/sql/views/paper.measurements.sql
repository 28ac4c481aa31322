-- What size had each true object on the sensor, and with which lens settings?
-- The sides of the box times the pitch of the stored pixels, as in section 3.3; a side that the
-- edge of the picture cuts is unknown.
CREATE OR REPLACE VIEW paper.measurements AS
SELECT
    matches.recording_id, recordings.file_name, matches.camera, matches.frame_index,
    matches.observation_index, matches.track_id, matches.object_id, matches.class_name,
    frames.f_number, frames.focal_length_mm,
    frames.focal_length_mm / (2 * frames.f_number) AS aperture_radius_mm,
    CASE
        WHEN NOT (truncated_left OR truncated_right) THEN x_max_px - x_min_px
    END AS object_width_px,
    object_width_px * frames.pixel_pitch_x_um / 1000 AS object_width_mm,
    CASE
        WHEN NOT (truncated_top OR truncated_bottom) THEN y_max_px - y_min_px
    END AS object_height_px,
    object_height_px * frames.pixel_pitch_y_um / 1000 AS object_height_mm,
    matches.true_depth_m, matches.true_height_m
FROM (
    FROM main.matches
    ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index)
) AS matches
JOIN main.observations USING (recording_id, observation_index)
JOIN main.frames
    ON frames.recording_id = matches.recording_id
    AND frames.camera = matches.camera AND frames.frame_index = matches.frame_index
JOIN main.recordings ON recordings.recording_id = matches.recording_id;

COMMENT ON VIEW paper.measurements IS 'What size had each true object on the sensor, and with which lens settings? One row for each matched observation: O_s, a_R, f and f-number of the paper. A side that the edge of the picture cuts is NULL.';
