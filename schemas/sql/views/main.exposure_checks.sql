-- Does the brightness of every picture agree with its exposure data?
CREATE OR REPLACE VIEW main.exposure_checks AS
FROM main.exposure_checks_between(NULL, NULL, NULL, NULL);

COMMENT ON VIEW main.exposure_checks IS 'Does the brightness of every picture agree with its exposure data? One row for each decoded frame. A moving or zooming camera, and a tone curve that is not sRGB, cause departures of their own.';
COMMENT ON COLUMN main.exposure_checks.scene_ev IS 'Brightness of the scene in stops, by luminance over t ISO / N^2 (Eq. 15), up to a constant of the camera; NULL where luminance or exposure time is unknown.';
COMMENT ON COLUMN main.exposure_checks.departure_ev IS 'scene_ev less the median of the five frames before and after; NULL where fewer than four of them tell.';
COMMENT ON COLUMN main.exposure_checks.step_ev IS 'Median of this frame and the four after less that of the five before.';
COMMENT ON COLUMN main.exposure_checks.scatter_ev IS 'Robust standard deviation of the camera''s departures.';
COMMENT ON COLUMN main.exposure_checks.verdict IS 'clipped (over 5 % of the pixels black or white), departs (from its neighbours, by half a stop and four scatters: exposure data that are not this picture''s), steps (the level changes here and stays: gain or light, which the data do not tell), agrees, or NULL where the data do not suffice.';
