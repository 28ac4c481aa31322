-- Table 11: how well does the inverse model fit?
CREATE OR REPLACE VIEW paper.inverse_model_summary AS
SELECT camera, class_name, observation_count, r, r2, adjusted_r2, std_error_m
FROM paper.inverse_model;

COMMENT ON VIEW paper.inverse_model_summary IS 'Table 11: how well does the inverse model, depth = b0 + b1 / size, fit? The paper prints R 0.990, R2 0.981, adjusted R2 0.981, standard error 3.012 cm.';
