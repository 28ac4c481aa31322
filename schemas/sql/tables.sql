-- The tables of a stadimeter database. A recording is the unit of replacement: all its rows come and
-- go in one transaction. There are no foreign keys (DuckDB cannot delete child and parent in one
-- transaction) and few indexes: tables are sorted by recording and time, which zone maps use.
-- Unknown is NULL, never zero. Units are part of each name.

CREATE TABLE IF NOT EXISTS runs (
    run_id           VARCHAR NOT NULL,
    command          VARCHAR NOT NULL,
    label            VARCHAR,
    started_at       TIMESTAMPTZ NOT NULL,
    finished_at      TIMESTAMPTZ,
    software_version VARCHAR NOT NULL,
    libraries        VARCHAR,
    configuration    VARCHAR NOT NULL,
    keep             BOOLEAN
);
COMMENT ON TABLE runs IS 'One row for each start of `stadimeter run`, `estimate` or `calibrate`, with its version and configuration.';
COMMENT ON COLUMN runs.run_id IS 'Name of the run.';
COMMENT ON COLUMN runs.command IS 'run, estimate or calibrate.';
COMMENT ON COLUMN runs.label IS 'Name that the user gave the run, for comparing runs.';
COMMENT ON COLUMN runs.started_at IS 'Time at which the run started.';
COMMENT ON COLUMN runs.finished_at IS 'Time at which the run ended; NULL if it did not end.';
COMMENT ON COLUMN runs.software_version IS 'Version of stadimeter.';
COMMENT ON COLUMN runs.libraries IS 'Versions of Python and the libraries, as JSON.';
COMMENT ON COLUMN runs.configuration IS 'The whole configuration, as JSON.';
COMMENT ON COLUMN runs.keep IS 'TRUE: `stadimeter runs keep` said that a later run of the same settings does not replace it.';

CREATE TABLE IF NOT EXISTS kept_runs (
    recording_id VARCHAR NOT NULL,
    measured_by  VARCHAR NOT NULL,
    run_id       VARCHAR NOT NULL,
    file_name    VARCHAR NOT NULL
);
COMMENT ON TABLE kept_runs IS 'One row for each run of a recording whose rows are kept beside the current measurement, in the tables of the schema `kept`.';
COMMENT ON COLUMN kept_runs.recording_id IS 'The recording.';
COMMENT ON COLUMN kept_runs.measured_by IS 'The run that read the pixels.';
COMMENT ON COLUMN kept_runs.run_id IS 'The run that estimated: the same, or a later `stadimeter estimate`.';
COMMENT ON COLUMN kept_runs.file_name IS 'Name of the file when it was read.';

CREATE TABLE IF NOT EXISTS chosen_runs (
    recording_id VARCHAR NOT NULL,
    run_id       VARCHAR NOT NULL
);
COMMENT ON TABLE chosen_runs IS 'One row for each recording of which `stadimeter runs current` chose the run that counts; without one it is the newest.';
COMMENT ON COLUMN chosen_runs.recording_id IS 'The recording.';
COMMENT ON COLUMN chosen_runs.run_id IS 'The run that counts.';

CREATE TABLE IF NOT EXISTS recordings (
    recording_id   VARCHAR NOT NULL,
    content_sha256 VARCHAR NOT NULL,
    file_name      VARCHAR NOT NULL,
    path           VARCHAR NOT NULL,
    size_bytes     BIGINT NOT NULL,
    start_time_ns  BIGINT,
    end_time_ns    BIGINT,
    frame_count    INTEGER NOT NULL,
    frames_lost    INTEGER NOT NULL,
    damaged        BOOLEAN NOT NULL,
    run_id         VARCHAR NOT NULL,
    tables_sha256  VARCHAR
);
COMMENT ON TABLE recordings IS 'One row for each recording, keyed by its content: the same bytes under another name are the same recording.';
COMMENT ON COLUMN recordings.recording_id IS 'First 16 hexadecimal digits of content_sha256.';
COMMENT ON COLUMN recordings.content_sha256 IS 'SHA-256 of the file.';
COMMENT ON COLUMN recordings.file_name IS 'Name of the file when it was last read.';
COMMENT ON COLUMN recordings.path IS 'Path of the file when it was last read.';
COMMENT ON COLUMN recordings.size_bytes IS 'Size of the file.';
COMMENT ON COLUMN recordings.start_time_ns IS 'Log time of the first frame, nanoseconds since 1970 UTC.';
COMMENT ON COLUMN recordings.end_time_ns IS 'Log time of the last frame, nanoseconds since 1970 UTC.';
COMMENT ON COLUMN recordings.frame_count IS 'Frames read, all cameras.';
COMMENT ON COLUMN recordings.frames_lost IS 'Frames known to be in the file that could not be decoded.';
COMMENT ON COLUMN recordings.damaged IS 'TRUE if any part of the file could not be read; see diagnostics.';
COMMENT ON COLUMN recordings.run_id IS 'The run that last read the pixels.';
COMMENT ON COLUMN recordings.tables_sha256 IS 'Hash of all rows of the recording as that run stored them, without names of files and runs: equal for the same bytes, version and settings. NULL: not known, or rows were taken away since.';

CREATE TABLE IF NOT EXISTS cameras (
    recording_id        VARCHAR NOT NULL,
    camera              VARCHAR NOT NULL,
    topic               VARCHAR NOT NULL,
    frame_id            VARCHAR,
    width_px            INTEGER,
    height_px           INTEGER,
    fx_px               DOUBLE,
    fy_px               DOUBLE,
    cx_px               DOUBLE,
    cy_px               DOUBLE,
    distortion_model    VARCHAR,
    distortion          DOUBLE[],
    intrinsics_source   VARCHAR,
    camera_height_m     DOUBLE,
    camera_height_std_m DOUBLE,
    tilt_rad            DOUBLE,
    tilt_std_rad        DOUBLE,
    roll_rad            DOUBLE,
    roll_std_rad        DOUBLE,
    pose_source         VARCHAR,
    recorded_height_m   DOUBLE,
    recorded_tilt_rad   DOUBLE,
    recorded_roll_rad   DOUBLE,
    recorded_ground_frame VARCHAR,
    focal_std_px        DOUBLE,
    centre_source       VARCHAR,
    distortion_source   VARCHAR,
    rectified_fx_px     DOUBLE,
    rectified_fy_px     DOUBLE,
    rectified_cx_px     DOUBLE,
    rectified_cy_px     DOUBLE,
    pose_loadings       DOUBLE[]
);
COMMENT ON TABLE cameras IS 'One row for each camera of a recording: its lens in pixels and, where known, its pose above the ground.';
COMMENT ON COLUMN cameras.recording_id IS 'The recording.';
COMMENT ON COLUMN cameras.camera IS 'Name of the camera: the frame_id of its images, or their topic.';
COMMENT ON COLUMN cameras.topic IS 'Topic of its images.';
COMMENT ON COLUMN cameras.frame_id IS 'frame_id of its images.';
COMMENT ON COLUMN cameras.width_px IS 'Width of its stored pictures.';
COMMENT ON COLUMN cameras.height_px IS 'Height of its stored pictures.';
COMMENT ON COLUMN cameras.fx_px IS 'Focal length in horizontal pixels of the stored picture.';
COMMENT ON COLUMN cameras.fy_px IS 'Focal length in vertical pixels of the stored picture.';
COMMENT ON COLUMN cameras.cx_px IS 'Principal point, horizontal.';
COMMENT ON COLUMN cameras.cy_px IS 'Principal point, vertical.';
COMMENT ON COLUMN cameras.distortion_model IS 'plumb_bob, rational_polynomial, equidistant, or empty.';
COMMENT ON COLUMN cameras.distortion IS 'Coefficients of the distortion model.';
COMMENT ON COLUMN cameras.intrinsics_source IS 'Origin of fx_px and fy_px: recording, camera_file, lens_data (focal length over pixel pitch, centre assumed), or walkers (found with the pose from the people who walk; square pixels, centre and no distortion assumed).';
COMMENT ON COLUMN cameras.centre_source IS 'Origin of cx_px and cy_px: recording, camera_file, walkers, or assumed (the middle of the picture).';
COMMENT ON COLUMN cameras.distortion_source IS 'Origin of the distortion: recording, camera_file, walkers, or assumed (none).';
COMMENT ON COLUMN cameras.rectified_fx_px IS 'Focal length in horizontal pixels if the pictures were rectified (P of the calibration); NULL where that is not open.';
COMMENT ON COLUMN cameras.rectified_fy_px IS 'The same in vertical pixels.';
COMMENT ON COLUMN cameras.rectified_cx_px IS 'Principal point if the pictures were rectified, horizontal.';
COMMENT ON COLUMN cameras.rectified_cy_px IS 'Principal point if the pictures were rectified, vertical.';
COMMENT ON COLUMN cameras.focal_std_px IS 'Standard error of fx_px and fy_px where they were found from walkers, now or when the camera file was written, or where walkers contradict lens data; NULL where they are given.';
COMMENT ON COLUMN cameras.camera_height_m IS 'Height of the camera above the ground.';
COMMENT ON COLUMN cameras.camera_height_std_m IS 'Standard error of camera_height_m.';
COMMENT ON COLUMN cameras.tilt_rad IS 'Tilt of the optical axis below the horizon.';
COMMENT ON COLUMN cameras.tilt_std_rad IS 'Standard error of tilt_rad.';
COMMENT ON COLUMN cameras.roll_rad IS 'Rotation about the optical axis.';
COMMENT ON COLUMN cameras.roll_std_rad IS 'Standard error of roll_rad.';
COMMENT ON COLUMN cameras.pose_source IS 'given (camera file), transforms (of the recording), walkers, or NULL where the pose is unknown.';
COMMENT ON COLUMN cameras.recorded_height_m IS 'Height of the camera above the ground by the transforms in the recording; used where no camera file gives a pose.';
COMMENT ON COLUMN cameras.recorded_tilt_rad IS 'Tilt below the horizon by the transforms in the recording.';
COMMENT ON COLUMN cameras.recorded_roll_rad IS 'Roll by the transforms in the recording.';
COMMENT ON COLUMN cameras.recorded_ground_frame IS 'The frame of the transforms whose plane z = 0 was taken for the ground; with recorded_height_m NULL the camera moves by the transforms, and has no one pose.';
COMMENT ON COLUMN cameras.pose_loadings IS 'Errors of the logarithm of camera_height_m, of tilt_rad and of roll_rad for one standard deviation of each of the six errors of track_heights.common_loadings_m, one after the other: 18 numbers; NULL where the pose is not from walkers.';

CREATE TABLE IF NOT EXISTS frames (
    recording_id          VARCHAR NOT NULL,
    camera                VARCHAR NOT NULL,
    frame_index           INTEGER NOT NULL,
    log_time_ns           BIGINT NOT NULL,
    capture_time_ns       BIGINT NOT NULL,
    image_format          VARCHAR,
    image_bytes           INTEGER,
    width_px              INTEGER,
    height_px             INTEGER,
    decoded               BOOLEAN NOT NULL,
    exposure_pairing      VARCHAR NOT NULL,
    exposure_offset_ns    BIGINT,
    exposure_time_s       DOUBLE,
    f_number              DOUBLE,
    iso_speed             DOUBLE,
    exposure_bias_ev      DOUBLE,
    brightness_ev         DOUBLE,
    gain_db               DOUBLE,
    focal_length_mm       DOUBLE,
    focal_length_35mm_mm  DOUBLE,
    focus_distance_m      DOUBLE,
    pixel_pitch_x_um      DOUBLE,
    pixel_pitch_y_um      DOUBLE,
    luminance             DOUBLE,
    clipped_fraction      DOUBLE,
    ev100                 DOUBLE,
    scene_luminance_cd_m2 DOUBLE,
    fx_px                 DOUBLE,
    fy_px                 DOUBLE,
    cx_px                 DOUBLE,
    cy_px                 DOUBLE,
    distortion_model      VARCHAR,
    distortion            DOUBLE[],
    intrinsics_source     VARCHAR
);
COMMENT ON TABLE frames IS 'One row for each frame: its times, its exposure and its brightness.';
COMMENT ON COLUMN frames.recording_id IS 'The recording.';
COMMENT ON COLUMN frames.camera IS 'The camera.';
COMMENT ON COLUMN frames.frame_index IS 'Number of the frame within its camera, from 0.';
COMMENT ON COLUMN frames.log_time_ns IS 'Time at which the frame was logged, nanoseconds since 1970 UTC.';
COMMENT ON COLUMN frames.capture_time_ns IS 'Time at which the frame was taken, by its own timestamp; the log time where it has none.';
COMMENT ON COLUMN frames.image_format IS 'Encoding of the picture as the recording states it.';
COMMENT ON COLUMN frames.image_bytes IS 'Size of the encoded picture.';
COMMENT ON COLUMN frames.width_px IS 'Width of the stored picture.';
COMMENT ON COLUMN frames.height_px IS 'Height of the stored picture.';
COMMENT ON COLUMN frames.decoded IS 'TRUE if the picture could be decoded.';
COMMENT ON COLUMN frames.exposure_pairing IS 'nearest (within the tolerance), last_known (before the frame), embedded (EXIF in the picture itself), or none.';
COMMENT ON COLUMN frames.exposure_offset_ns IS 'Time of the exposure message less that of the frame.';
COMMENT ON COLUMN frames.exposure_time_s IS 'Exposure time (shutter speed).';
COMMENT ON COLUMN frames.f_number IS 'f-number: focal length over aperture diameter.';
COMMENT ON COLUMN frames.iso_speed IS 'Photographic sensitivity (ISO).';
COMMENT ON COLUMN frames.exposure_bias_ev IS 'Exposure bias.';
COMMENT ON COLUMN frames.brightness_ev IS 'Brightness of the scene as the camera metered it (APEX, EXIF BrightnessValue).';
COMMENT ON COLUMN frames.gain_db IS 'Sensor gain, where ISO is not known.';
COMMENT ON COLUMN frames.focal_length_mm IS 'Focal length.';
COMMENT ON COLUMN frames.focal_length_35mm_mm IS 'Focal length before 35 mm film that sees the same angle across the diagonal; it gives the pixel pitch where none is stated.';
COMMENT ON COLUMN frames.focus_distance_m IS 'Distance on which the lens is focused; infinity is a value, NULL is unknown.';
COMMENT ON COLUMN frames.pixel_pitch_x_um IS 'Horizontal pitch of the pixels of the stored picture, on the sensor.';
COMMENT ON COLUMN frames.pixel_pitch_y_um IS 'Vertical pitch of the pixels of the stored picture, on the sensor.';
COMMENT ON COLUMN frames.luminance IS 'Mean relative luminance of the picture, linear light, 0..1 (Eq. 15).';
COMMENT ON COLUMN frames.clipped_fraction IS 'Share of the pixels that are black or white.';
COMMENT ON COLUMN frames.ev100 IS 'Exposure value at ISO 100.';
COMMENT ON COLUMN frames.fx_px IS 'Focal length of the lens of this picture in horizontal pixels; NULL where it is not known. Boxes are taken to the lens of `cameras`, which most pictures have.';
COMMENT ON COLUMN frames.fy_px IS 'The same in vertical pixels.';
COMMENT ON COLUMN frames.cx_px IS 'Principal point of this picture, horizontal.';
COMMENT ON COLUMN frames.cy_px IS 'Principal point of this picture, vertical.';
COMMENT ON COLUMN frames.distortion_model IS 'Distortion model of the lens of this picture, or empty.';
COMMENT ON COLUMN frames.distortion IS 'Coefficients of that model.';
COMMENT ON COLUMN frames.intrinsics_source IS 'Origin of fx_px and fy_px of this picture: recording, camera_file or lens_data.';
COMMENT ON COLUMN frames.scene_luminance_cd_m2 IS 'Luminance of a scene that this exposure renders mid-grey.';

CREATE TABLE IF NOT EXISTS background_lines (
    recording_id VARCHAR NOT NULL,
    camera       VARCHAR NOT NULL,
    x0_px        DOUBLE NOT NULL,
    y0_px        DOUBLE NOT NULL,
    x1_px        DOUBLE NOT NULL,
    y1_px        DOUBLE NOT NULL
);
COMMENT ON TABLE background_lines IS 'Straight edges of things that never move before a camera; upright ones give its roll and tilt.';
COMMENT ON COLUMN background_lines.recording_id IS 'The recording.';
COMMENT ON COLUMN background_lines.camera IS 'The camera.';
COMMENT ON COLUMN background_lines.x0_px IS 'Column of one end, in pixels of the stored picture.';
COMMENT ON COLUMN background_lines.y0_px IS 'Row of that end.';
COMMENT ON COLUMN background_lines.x1_px IS 'Column of the other end.';
COMMENT ON COLUMN background_lines.y1_px IS 'Row of the other end.';

CREATE TABLE IF NOT EXISTS tracks (
    recording_id      VARCHAR NOT NULL,
    camera            VARCHAR NOT NULL,
    track_id          INTEGER NOT NULL,
    class_name        VARCHAR,
    object_id         VARCHAR,
    first_frame_index INTEGER NOT NULL,
    last_frame_index  INTEGER NOT NULL,
    first_time_ns     BIGINT NOT NULL,
    last_time_ns      BIGINT NOT NULL,
    observation_count INTEGER NOT NULL,
    filled_count      INTEGER,
    looked_at_count   INTEGER,
    confirmed_count   INTEGER,
    verdict           VARCHAR
);
COMMENT ON TABLE tracks IS 'One row for each object that was followed over frames.';
COMMENT ON COLUMN tracks.recording_id IS 'The recording.';
COMMENT ON COLUMN tracks.camera IS 'The camera.';
COMMENT ON COLUMN tracks.track_id IS 'Number of the track within its camera.';
COMMENT ON COLUMN tracks.class_name IS 'Class of the object: that of most of its observations.';
COMMENT ON COLUMN tracks.object_id IS 'The recording''s own id of the object, where its detections have one.';
COMMENT ON COLUMN tracks.first_frame_index IS 'First frame in which it was seen.';
COMMENT ON COLUMN tracks.last_frame_index IS 'Last frame in which it was seen.';
COMMENT ON COLUMN tracks.first_time_ns IS 'Capture time of the first frame.';
COMMENT ON COLUMN tracks.last_time_ns IS 'Capture time of the last frame.';
COMMENT ON COLUMN tracks.observation_count IS 'Number of frames in which it was seen.';
COMMENT ON COLUMN tracks.filled_count IS 'Number of frames in which it was not seen, but filled in: gaps of up to a second. NULL for tracks that the recording itself gives.';
COMMENT ON COLUMN tracks.looked_at_count IS 'Number of its frames, uncut by the picture''s edge, in which a network looked for people; NULL without a network.';
COMMENT ON COLUMN tracks.confirmed_count IS 'Number of these in which the network found a person there.';
COMMENT ON COLUMN tracks.verdict IS 'Decision on the class: confirmed or refused (by a network that looked at some frames), implausible (too fast for a person), undecided (nothing tells; with a network: it never saw the track whole). Tracks that are not confirmed, where there is a network, and implausible ones have the class unknown: no stature is assumed of them, and they tell nothing of the camera. NULL if the class is the word of the recording or of a network that found every box.';

CREATE TABLE IF NOT EXISTS observations (
    recording_id      VARCHAR NOT NULL,
    observation_index INTEGER NOT NULL,
    camera            VARCHAR NOT NULL,
    frame_index       INTEGER NOT NULL,
    track_id          INTEGER NOT NULL,
    object_id         VARCHAR,
    class_name        VARCHAR,
    detector          VARCHAR NOT NULL,
    score             DOUBLE,
    x_min_px          DOUBLE NOT NULL,
    y_min_px          DOUBLE NOT NULL,
    x_max_px          DOUBLE NOT NULL,
    y_max_px          DOUBLE NOT NULL,
    x_min_std_px      DOUBLE,
    y_min_std_px      DOUBLE,
    x_max_std_px      DOUBLE,
    y_max_std_px      DOUBLE,
    truncated_left    BOOLEAN,
    truncated_top     BOOLEAN,
    truncated_right   BOOLEAN,
    truncated_bottom  BOOLEAN,
    occlusion         DOUBLE,
    luminance         DOUBLE,
    blur_sigma_px     DOUBLE,
    blur_std_px       DOUBLE,
    blur_edge_count   INTEGER,
    blur_reason       VARCHAR,
    measured          BOOLEAN,
    confirmed         BOOLEAN,
    raw_x_min_px      DOUBLE,
    raw_y_min_px      DOUBLE,
    raw_x_max_px      DOUBLE,
    raw_y_max_px      DOUBLE
);
COMMENT ON TABLE observations IS 'One row for each object in each frame: the measurements of pass 1 in the picture.';
COMMENT ON COLUMN observations.recording_id IS 'The recording.';
COMMENT ON COLUMN observations.observation_index IS 'Number of the observation within its recording, from 0.';
COMMENT ON COLUMN observations.camera IS 'The camera.';
COMMENT ON COLUMN observations.frame_index IS 'The frame.';
COMMENT ON COLUMN observations.track_id IS 'The track.';
COMMENT ON COLUMN observations.object_id IS 'The recording''s own id of the object, where its detections have one.';
COMMENT ON COLUMN observations.class_name IS 'Class of the object; unknown where the detector cannot tell.';
COMMENT ON COLUMN observations.detector IS 'Name of the detector: recorded, roi, motion, or that of a network or another detector.';
COMMENT ON COLUMN observations.score IS 'Confidence of the detector, 0..1.';
COMMENT ON COLUMN observations.x_min_px IS 'Left edge of the box, pixels of the stored picture.';
COMMENT ON COLUMN observations.y_min_px IS 'Upper edge of the box (the head of a person).';
COMMENT ON COLUMN observations.x_max_px IS 'Right edge of the box.';
COMMENT ON COLUMN observations.y_max_px IS 'Lower edge of the box (the feet of a person).';
COMMENT ON COLUMN observations.x_min_std_px IS 'Standard deviation of the left edge.';
COMMENT ON COLUMN observations.y_min_std_px IS 'Standard deviation of the upper edge.';
COMMENT ON COLUMN observations.x_max_std_px IS 'Standard deviation of the right edge.';
COMMENT ON COLUMN observations.y_max_std_px IS 'Standard deviation of the lower edge.';
COMMENT ON COLUMN observations.truncated_left IS 'TRUE if the left edge of the picture cuts the object.';
COMMENT ON COLUMN observations.truncated_top IS 'TRUE if the upper edge of the picture cuts the object.';
COMMENT ON COLUMN observations.truncated_right IS 'TRUE if the right edge of the picture cuts the object.';
COMMENT ON COLUMN observations.truncated_bottom IS 'TRUE if the lower edge of the picture cuts the object.';
COMMENT ON COLUMN observations.occlusion IS 'Share of the box that the boxes of nearer objects cover, 0..1.';
COMMENT ON COLUMN observations.luminance IS 'Mean relative luminance inside the box, linear light, 0..1.';
COMMENT ON COLUMN observations.blur_sigma_px IS 'Blur of the object''s edges: standard deviation of the spread of a step, pixels of the stored picture, the camera''s own softness included. NULL where it was not measured; blur_reason says why.';
COMMENT ON COLUMN observations.blur_std_px IS 'Its standard deviation, from the differences between the object''s edges.';
COMMENT ON COLUMN observations.blur_edge_count IS 'Number of edges that were used.';
COMMENT ON COLUMN observations.blur_reason IS 'Reason for which there is no blur: lens_unknown (f-number, focal length, focus distance or pitch), unresolvable (at no possible depth would it be blurred more than by the lens itself, or its box is too small: its pixels were not read), no_edges, too_wide (blurred over too much of itself), motion, too_many (in one frame), no_picture, not_measured (filled in).';
COMMENT ON COLUMN observations.measured IS 'FALSE if the object was not found in this frame, but in frames up to a second before and after: the box is filled in between, and its deviations are wide.';
COMMENT ON COLUMN observations.confirmed IS 'TRUE or FALSE if a network looked at this frame and found, or did not find, a person there; else NULL.';
COMMENT ON COLUMN observations.raw_x_min_px IS 'Left edge of the box as the detector found it; x_min_px is smoothed along the track. NULL if it was filled in.';
COMMENT ON COLUMN observations.raw_y_min_px IS 'Upper edge of the box as the detector found it.';
COMMENT ON COLUMN observations.raw_x_max_px IS 'Right edge of the box as the detector found it.';
COMMENT ON COLUMN observations.raw_y_max_px IS 'Lower edge of the box as the detector found it.';

CREATE TABLE IF NOT EXISTS estimates (
    recording_id        VARCHAR NOT NULL,
    run_id              VARCHAR NOT NULL,
    observation_index   INTEGER NOT NULL,
    method              VARCHAR NOT NULL,
    calibration_id      VARCHAR,
    depth_m             DOUBLE,
    depth_std_m         DOUBLE,
    height_m            DOUBLE,
    height_std_m        DOUBLE,
    height_assumed      BOOLEAN,
    range_m             DOUBLE,
    x_m                 DOUBLE,
    y_m                 DOUBLE,
    in_calibrated_range BOOLEAN,
    branch              VARCHAR
);
COMMENT ON TABLE estimates IS 'One row for each observation, method and run: depth and height with their standard deviations. Use main.current_estimates for the newest run of each recording.';
COMMENT ON COLUMN estimates.recording_id IS 'The recording.';
COMMENT ON COLUMN estimates.run_id IS 'The run that made the estimate.';
COMMENT ON COLUMN estimates.observation_index IS 'The observation.';
COMMENT ON COLUMN estimates.method IS 'Name of the method, as in the table of methods of the README; fused combines the others.';
COMMENT ON COLUMN estimates.calibration_id IS 'The calibration that was used.';
COMMENT ON COLUMN estimates.depth_m IS 'Distance along the optical axis.';
COMMENT ON COLUMN estimates.depth_std_m IS 'Standard deviation of depth_m; the 95 % interval is 1.96 of it to either side.';
COMMENT ON COLUMN estimates.height_m IS 'Height of the object; of a person who walks, the height when standing, which is 3.3 cm more than the picture shows (pipeline/estimate/gait.py).';
COMMENT ON COLUMN estimates.height_std_m IS 'Standard deviation of height_m.';
COMMENT ON COLUMN estimates.height_assumed IS 'TRUE where the height was assumed (the depth came from a prior on height), not measured.';
COMMENT ON COLUMN estimates.range_m IS 'Euclidean distance to the middle of the object.';
COMMENT ON COLUMN estimates.x_m IS 'Position on the ground to the right of the camera; across the axis where the pose is unknown.';
COMMENT ON COLUMN estimates.y_m IS 'Position on the ground ahead of the camera; along the axis where the pose is unknown.';
COMMENT ON COLUMN estimates.in_calibrated_range IS 'FALSE where the calibration is used outside the range in which it was fitted; NULL where it states none.';
COMMENT ON COLUMN estimates.branch IS 'Of defocus: near (in front of the plane of focus) or far (behind it): a blur belongs to one depth on either side. NULL for other methods.';

CREATE TABLE IF NOT EXISTS track_heights (
    recording_id      VARCHAR NOT NULL,
    run_id            VARCHAR NOT NULL,
    camera            VARCHAR NOT NULL,
    track_id          INTEGER NOT NULL,
    method            VARCHAR NOT NULL,
    height_m          DOUBLE,
    height_std_m      DOUBLE,
    height_assumed    BOOLEAN,
    height_plausible  BOOLEAN,
    depth_min_m       DOUBLE,
    depth_median_m    DOUBLE,
    depth_max_m       DOUBLE,
    observation_count INTEGER NOT NULL,
    height_low_m      DOUBLE,
    height_high_m     DOUBLE,
    own_std_m         DOUBLE,
    common_loadings_m FLOAT[6],
    scale_share       FLOAT,
    camera_share      FLOAT,
    boxes_share       FLOAT,
    posture_share     FLOAT,
    doubt_share       FLOAT
);
COMMENT ON TABLE track_heights IS 'One row for each track, method and run: the height of the object over all its frames, and its depths.';
COMMENT ON COLUMN track_heights.recording_id IS 'The recording.';
COMMENT ON COLUMN track_heights.run_id IS 'The run that made the estimate.';
COMMENT ON COLUMN track_heights.camera IS 'The camera.';
COMMENT ON COLUMN track_heights.track_id IS 'The track.';
COMMENT ON COLUMN track_heights.method IS 'The method.';
COMMENT ON COLUMN track_heights.height_m IS 'Robust combination of the heights of its frames.';
COMMENT ON COLUMN track_heights.height_std_m IS 'Its standard deviation: of the frames as far as they are independent, of the gait, of the calibration, and of the chance that the box is not of one person.';
COMMENT ON COLUMN track_heights.height_assumed IS 'TRUE where the height was assumed, not measured.';
COMMENT ON COLUMN track_heights.height_plausible IS 'FALSE where one object of its class cannot be so tall or so small: two people in one box, or half of one. NULL where nothing is known of the class, or the height was assumed.';
COMMENT ON COLUMN track_heights.depth_min_m IS 'Nearest depth.';
COMMENT ON COLUMN track_heights.depth_median_m IS 'Median depth.';
COMMENT ON COLUMN track_heights.depth_max_m IS 'Farthest depth.';
COMMENT ON COLUMN track_heights.height_low_m IS 'Lower end of the 95 % interval of the height.';
COMMENT ON COLUMN track_heights.height_high_m IS 'Upper end of the 95 % interval of the height.';
COMMENT ON COLUMN track_heights.own_std_m IS 'Standard deviation of the part of the error that no other track of the camera shares, without the doubt that the track is one person; NULL where the pose is not from the walkers of this recording.';
COMMENT ON COLUMN track_heights.common_loadings_m IS 'Error of the height for one standard deviation of each of six independent errors that all tracks of the camera share; the first is that of the scale. The variance of a difference of two heights is the squared array_distance of these, and both own variances (macro height_difference).';
COMMENT ON COLUMN track_heights.scale_share IS 'Share of the variance of the height that the mean stature of the people here, or what is known instead, makes.';
COMMENT ON COLUMN track_heights.camera_share IS 'Share that the rest of the pose and the lens make.';
COMMENT ON COLUMN track_heights.boxes_share IS 'Share that the ends of the boxes make, in common and by themselves.';
COMMENT ON COLUMN track_heights.posture_share IS 'Share that gait and feet of this person make.';
COMMENT ON COLUMN track_heights.doubt_share IS 'Share that the doubt makes that the track is one person.';
COMMENT ON COLUMN track_heights.observation_count IS 'Number of estimates that were used.';

CREATE TABLE IF NOT EXISTS track_cadences (
    recording_id      VARCHAR NOT NULL,
    run_id            VARCHAR NOT NULL,
    camera            VARCHAR NOT NULL,
    track_id          INTEGER NOT NULL,
    cadence_hz        DOUBLE,
    cadence_std_hz    DOUBLE,
    window_count      INTEGER,
    speed_m_s         DOUBLE
);
COMMENT ON TABLE track_cadences IS 'One row for each run and track of a person whose cadence can be read: from boxes that were measured, at 5 frames a second or more, in windows of 5 s. Most tracks have none.';
COMMENT ON COLUMN track_cadences.recording_id IS 'The recording.';
COMMENT ON COLUMN track_cadences.run_id IS 'The run that read it.';
COMMENT ON COLUMN track_cadences.camera IS 'The camera.';
COMMENT ON COLUMN track_cadences.track_id IS 'The track.';
COMMENT ON COLUMN track_cadences.cadence_hz IS 'Steps a second, 1.3 to 2.6: the frequency at which the upper edge and the width of the box swing (pipeline/estimate/cadence.py).';
COMMENT ON COLUMN track_cadences.cadence_std_hz IS 'Standard deviation of cadence_hz.';
COMMENT ON COLUMN track_cadences.window_count IS 'Number of windows of 5 s that show it.';
COMMENT ON COLUMN track_cadences.speed_m_s IS 'Median speed on the ground along the track; NULL where the pose is unknown.';

CREATE TABLE IF NOT EXISTS observation_quality (
    recording_id      VARCHAR NOT NULL,
    run_id            VARCHAR NOT NULL,
    observation_index INTEGER NOT NULL,
    quality           DOUBLE,
    contact_visible   BOOLEAN,
    head_visible      BOOLEAN,
    aspect_plausible  BOOLEAN,
    alone             BOOLEAN,
    stride_phase_rad  DOUBLE
);
COMMENT ON TABLE observation_quality IS 'One row for each observation and run: how far the box can be trusted. No observation is dropped; bad ones have larger standard deviations in main.estimates.';
COMMENT ON COLUMN observation_quality.recording_id IS 'The recording.';
COMMENT ON COLUMN observation_quality.run_id IS 'The run that judged it.';
COMMENT ON COLUMN observation_quality.observation_index IS 'The observation.';
COMMENT ON COLUMN observation_quality.quality IS 'Weight of the worse end of the box, relative to the same box with nothing wrong, 0..1; 0 where the picture cuts off the head or the feet.';
COMMENT ON COLUMN observation_quality.contact_visible IS 'TRUE if the feet can be seen where they touch the ground: not below the picture, not behind the box of a nearer object, and the box not so much smaller than the rest of the track that something without a box must hide them.';
COMMENT ON COLUMN observation_quality.head_visible IS 'TRUE if the head can be seen: not above the picture, not behind the box of a nearer object.';
COMMENT ON COLUMN observation_quality.aspect_plausible IS 'FALSE where the shape of the box is not that of one upright person, or has changed by more than a stride does.';
COMMENT ON COLUMN observation_quality.alone IS 'FALSE where the box is so much taller than the rest of the track that another person must be in it.';
COMMENT ON COLUMN observation_quality.stride_phase_rad IS 'Phase of the step: 0 with the feet farthest apart, +-pi when together; NULL where the width of the box has no rhythm. No estimate uses it.';

CREATE TABLE IF NOT EXISTS ground_truth (
    recording_id VARCHAR NOT NULL,
    camera       VARCHAR NOT NULL,
    frame_index  INTEGER NOT NULL,
    object_id    VARCHAR NOT NULL,
    class_name   VARCHAR,
    depth_m      DOUBLE,
    range_m      DOUBLE,
    height_m     DOUBLE,
    width_m      DOUBLE,
    x_m          DOUBLE,
    y_m          DOUBLE,
    x_min_px     DOUBLE,
    y_min_px     DOUBLE,
    x_max_px     DOUBLE,
    y_max_px     DOUBLE,
    file_name    VARCHAR
);
COMMENT ON TABLE ground_truth IS 'One row for each object in each frame whose truth is known, by survey or by construction.';
COMMENT ON COLUMN ground_truth.recording_id IS 'The recording.';
COMMENT ON COLUMN ground_truth.camera IS 'The camera.';
COMMENT ON COLUMN ground_truth.frame_index IS 'The frame.';
COMMENT ON COLUMN ground_truth.object_id IS 'Name of the object, the same in every frame.';
COMMENT ON COLUMN ground_truth.class_name IS 'Class of the object.';
COMMENT ON COLUMN ground_truth.depth_m IS 'True distance along the optical axis.';
COMMENT ON COLUMN ground_truth.range_m IS 'True Euclidean distance.';
COMMENT ON COLUMN ground_truth.height_m IS 'True height.';
COMMENT ON COLUMN ground_truth.width_m IS 'True width.';
COMMENT ON COLUMN ground_truth.x_m IS 'True position on the ground to the right of the camera.';
COMMENT ON COLUMN ground_truth.y_m IS 'True position on the ground ahead of the camera.';
COMMENT ON COLUMN ground_truth.x_min_px IS 'Left edge of the true box.';
COMMENT ON COLUMN ground_truth.y_min_px IS 'Upper edge of the true box.';
COMMENT ON COLUMN ground_truth.x_max_px IS 'Right edge of the true box.';
COMMENT ON COLUMN ground_truth.y_max_px IS 'Lower edge of the true box.';

COMMENT ON COLUMN ground_truth.file_name IS 'File that it was read from by `stadimeter truth`; it stays when the recording is measured again. NULL for truth that the recording holds.';

CREATE TABLE IF NOT EXISTS labelled_frames (
    recording_id VARCHAR NOT NULL,
    camera       VARCHAR NOT NULL,
    frame_index  INTEGER NOT NULL,
    file_name    VARCHAR
);
COMMENT ON TABLE labelled_frames IS 'Frames for which a file of truth says who is there, one row for each: in others a box is neither right nor wrong.';
COMMENT ON COLUMN labelled_frames.recording_id IS 'The recording.';
COMMENT ON COLUMN labelled_frames.camera IS 'The camera.';
COMMENT ON COLUMN labelled_frames.frame_index IS 'The frame.';
COMMENT ON COLUMN labelled_frames.file_name IS 'The file of truth.';

CREATE TABLE IF NOT EXISTS ignore_regions (
    recording_id      VARCHAR NOT NULL,
    camera            VARCHAR NOT NULL,
    first_frame_index INTEGER NOT NULL,
    last_frame_index  INTEGER NOT NULL,
    x_min_px          DOUBLE NOT NULL,
    y_min_px          DOUBLE NOT NULL,
    x_max_px          DOUBLE NOT NULL,
    y_max_px          DOUBLE NOT NULL,
    file_name         VARCHAR
);
COMMENT ON TABLE ignore_regions IS 'Regions of frames in which the truth is not complete: boxes that lie in them by more than half, and match no true object, are not counted.';
COMMENT ON COLUMN ignore_regions.recording_id IS 'The recording.';
COMMENT ON COLUMN ignore_regions.camera IS 'The camera.';
COMMENT ON COLUMN ignore_regions.first_frame_index IS 'First frame in which the region is ignored.';
COMMENT ON COLUMN ignore_regions.last_frame_index IS 'Last frame in which the region is ignored.';
COMMENT ON COLUMN ignore_regions.x_min_px IS 'Left edge of the region.';
COMMENT ON COLUMN ignore_regions.y_min_px IS 'Upper edge of the region.';
COMMENT ON COLUMN ignore_regions.x_max_px IS 'Right edge of the region.';
COMMENT ON COLUMN ignore_regions.y_max_px IS 'Lower edge of the region.';
COMMENT ON COLUMN ignore_regions.file_name IS 'The file of truth.';

CREATE TABLE IF NOT EXISTS tracking_accuracy (
    recording_id           VARCHAR NOT NULL,
    camera                 VARCHAR NOT NULL,
    grouping               VARCHAR NOT NULL,
    class_name             VARCHAR,
    true_depth_from_m      DOUBLE,
    true_depth_to_m        DOUBLE,
    overlap                DOUBLE NOT NULL,
    true_count             BIGINT NOT NULL,
    observed_count         BIGINT NOT NULL,
    matched_count          BIGINT NOT NULL,
    association_sum        DOUBLE NOT NULL,
    overlap_sum            DOUBLE NOT NULL,
    clear_matched_count    BIGINT,
    switch_count           BIGINT,
    fragment_count         BIGINT,
    identity_matched_count BIGINT
);
COMMENT ON TABLE tracking_accuracy IS 'Agreement of boxes and tracks with the truth, one row for each recording, camera, group and least overlap: counts and sums that add up over recordings. The views accuracy.detection and accuracy.tracking make figures of them.';
COMMENT ON COLUMN tracking_accuracy.recording_id IS 'The recording.';
COMMENT ON COLUMN tracking_accuracy.camera IS 'The camera.';
COMMENT ON COLUMN tracking_accuracy.grouping IS 'all, class (one class of objects alone) or range (true depths of one bin alone; a box that matches nothing is in the bin of its estimated depth).';
COMMENT ON COLUMN tracking_accuracy.class_name IS 'Class of the group; NULL for other groupings.';
COMMENT ON COLUMN tracking_accuracy.true_depth_from_m IS 'Begin of the bin of depth; NULL for other groupings.';
COMMENT ON COLUMN tracking_accuracy.true_depth_to_m IS 'End of the bin of depth, not included; NULL for other groupings.';
COMMENT ON COLUMN tracking_accuracy.overlap IS 'Least intersection over union at which a box counts as found: 0.05, 0.1 ... 0.95.';
COMMENT ON COLUMN tracking_accuracy.true_count IS 'Number of true boxes.';
COMMENT ON COLUMN tracking_accuracy.observed_count IS 'Number of boxes that were found, in the frames that are labelled.';
COMMENT ON COLUMN tracking_accuracy.matched_count IS 'Number of true positives, by the assignment of HOTA.';
COMMENT ON COLUMN tracking_accuracy.association_sum IS 'Sum over the true positives of the association accuracy of their pair of identities (Luiten et al. 2021, Eq. 7).';
COMMENT ON COLUMN tracking_accuracy.overlap_sum IS 'Sum of the overlaps of the true positives.';
COMMENT ON COLUMN tracking_accuracy.clear_matched_count IS 'Number of matches by the assignment of CLEAR MOT, at the overlap 0.5; NULL at others.';
COMMENT ON COLUMN tracking_accuracy.switch_count IS 'Number of identity switches, at the overlap 0.5.';
COMMENT ON COLUMN tracking_accuracy.fragment_count IS 'Number of times that a true track is lost and found again, at the overlap 0.5.';
COMMENT ON COLUMN tracking_accuracy.identity_matched_count IS 'Number of boxes that one assignment of identities explains (IDTP of IDF1), at the overlap 0.5.';

CREATE TABLE IF NOT EXISTS matches (
    recording_id      VARCHAR NOT NULL,
    camera            VARCHAR NOT NULL,
    frame_index       INTEGER NOT NULL,
    observation_index INTEGER NOT NULL,
    object_id         VARCHAR NOT NULL,
    rule              VARCHAR NOT NULL,
    overlap           DOUBLE,
    track_id          INTEGER NOT NULL,
    class_name        VARCHAR,
    capture_time_ns   BIGINT,
    f_number          DOUBLE,
    true_depth_m      DOUBLE,
    true_range_m      DOUBLE,
    true_height_m     DOUBLE
);
COMMENT ON TABLE matches IS 'Pairs of an observation and the true object that it shows, with the truth. Matched by object_id, where the recording''s truth for that camera has the observation''s object_id; else by overlap: intersection over union of the boxes at least 0.5, each being the other''s best. Made once, when the recording is read, so that accuracy views join only this table with the estimates.';
COMMENT ON COLUMN matches.recording_id IS 'The recording.';
COMMENT ON COLUMN matches.camera IS 'The camera.';
COMMENT ON COLUMN matches.frame_index IS 'The frame.';
COMMENT ON COLUMN matches.observation_index IS 'The observation.';
COMMENT ON COLUMN matches.object_id IS 'The true object.';
COMMENT ON COLUMN matches.rule IS 'object_id or overlap.';
COMMENT ON COLUMN matches.overlap IS 'Intersection over union of the two boxes, where both are known.';
COMMENT ON COLUMN matches.track_id IS 'The observation''s track.';
COMMENT ON COLUMN matches.class_name IS 'Class of the true object; that of the observation where the truth has none.';
COMMENT ON COLUMN matches.capture_time_ns IS 'Time at which the frame was taken.';
COMMENT ON COLUMN matches.f_number IS 'The frame''s f-number.';
COMMENT ON COLUMN matches.true_depth_m IS 'True distance along the optical axis.';
COMMENT ON COLUMN matches.true_range_m IS 'True Euclidean distance.';
COMMENT ON COLUMN matches.true_height_m IS 'True height.';

CREATE TABLE IF NOT EXISTS calibrations (
    calibration_id    VARCHAR NOT NULL,
    run_id            VARCHAR NOT NULL,
    camera            VARCHAR,
    object_class      VARCHAR NOT NULL,
    dimension         VARCHAR NOT NULL,
    method            VARCHAR NOT NULL,
    parameter         VARCHAR NOT NULL,
    f_number          DOUBLE,
    value             DOUBLE NOT NULL,
    std_error         DOUBLE,
    residual_std_m    DOUBLE,
    observation_count INTEGER,
    depth_min_m       DOUBLE,
    depth_max_m       DOUBLE,
    fit_rmse_m        DOUBLE,
    loo_rmse_m        DOUBLE,
    kfold_rmse_m      DOUBLE,
    source            VARCHAR
);
COMMENT ON TABLE calibrations IS 'One row for each parameter of a calibration that a run used or made.';
COMMENT ON COLUMN calibrations.calibration_id IS 'Hash of the calibration''s numbers.';
COMMENT ON COLUMN calibrations.run_id IS 'The run that used or made it.';
COMMENT ON COLUMN calibrations.camera IS 'The camera that it is for; empty is any.';
COMMENT ON COLUMN calibrations.object_class IS 'The class of objects that it is for.';
COMMENT ON COLUMN calibrations.dimension IS 'width or height: the side of the box that it uses.';
COMMENT ON COLUMN calibrations.method IS 'aperture, inverse or size.';
COMMENT ON COLUMN calibrations.parameter IS 'k, b0_m, b1_m_mm or object_size_m.';
COMMENT ON COLUMN calibrations.f_number IS 'The f-number at which the parameter holds; NULL is any.';
COMMENT ON COLUMN calibrations.value IS 'The parameter.';
COMMENT ON COLUMN calibrations.std_error IS 'Standard error of value.';
COMMENT ON COLUMN calibrations.residual_std_m IS 'Spread of depth about the fit.';
COMMENT ON COLUMN calibrations.observation_count IS 'Observations that the fit used.';
COMMENT ON COLUMN calibrations.depth_min_m IS 'Nearest depth of the fit.';
COMMENT ON COLUMN calibrations.depth_max_m IS 'Farthest depth of the fit.';
COMMENT ON COLUMN calibrations.fit_rmse_m IS 'RMSE on the data of the fit.';
COMMENT ON COLUMN calibrations.loo_rmse_m IS 'RMSE of leave-one-out.';
COMMENT ON COLUMN calibrations.kfold_rmse_m IS 'RMSE of k-fold cross-validation.';
COMMENT ON COLUMN calibrations.source IS 'Origin of the calibration.';

CREATE TABLE IF NOT EXISTS diagnostics (
    recording_id VARCHAR,
    run_id       VARCHAR NOT NULL,
    file_name    VARCHAR,
    severity     VARCHAR NOT NULL,
    code         VARCHAR NOT NULL,
    message      VARCHAR NOT NULL,
    camera       VARCHAR,
    topic        VARCHAR,
    byte_offset  BIGINT,
    log_time_ns  BIGINT,
    end_time_ns  BIGINT,
    count        BIGINT NOT NULL
);
COMMENT ON TABLE diagnostics IS 'One row for each thing in the input that was refused, assumed, repaired or lost.';
COMMENT ON COLUMN diagnostics.recording_id IS 'The recording; NULL where the file is no recording.';
COMMENT ON COLUMN diagnostics.run_id IS 'The run that found it.';
COMMENT ON COLUMN diagnostics.file_name IS 'Name of the file.';
COMMENT ON COLUMN diagnostics.severity IS 'info, warning (a value was refused or assumed) or error (data were lost).';
COMMENT ON COLUMN diagnostics.code IS 'A word for the kind of diagnostic that does not change between versions.';
COMMENT ON COLUMN diagnostics.message IS 'Text: the cause, the effect, and what to do.';
COMMENT ON COLUMN diagnostics.camera IS 'The camera.';
COMMENT ON COLUMN diagnostics.topic IS 'The topic.';
COMMENT ON COLUMN diagnostics.byte_offset IS 'Offset in the file, bytes.';
COMMENT ON COLUMN diagnostics.log_time_ns IS 'Time, or the start of the time that is affected, nanoseconds since 1970 UTC.';
COMMENT ON COLUMN diagnostics.end_time_ns IS 'End of the time that is affected, nanoseconds since 1970 UTC.';
COMMENT ON COLUMN diagnostics.count IS 'Number of times that it happened.';
