-- Does accuracy depend on the aperture?
CREATE OR REPLACE VIEW accuracy.by_aperture AS
FROM accuracy.metrics_by(['aperture'])
ORDER BY f_number, method;

COMMENT ON VIEW accuracy.by_aperture IS 'Does accuracy depend on the aperture? NULL: the f-number is not known.';
