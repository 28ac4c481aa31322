-- Which kinds of objects are estimated well?
CREATE OR REPLACE VIEW accuracy.by_class AS
FROM accuracy.metrics_by(['class'])
ORDER BY class_name, method;

COMMENT ON VIEW accuracy.by_class IS 'Which kinds of objects are estimated well?';
