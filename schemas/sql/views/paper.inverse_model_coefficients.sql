-- Table 13: what are the coefficients of the inverse model, and are they different from zero?
CREATE OR REPLACE VIEW paper.inverse_model_coefficients AS
WITH terms AS (
    SELECT
        camera, class_name, residual_df AS df,
        unnest([
            {
                'term': '1 / object size', 'unit': 'm mm', 'b': b1_m_mm,
                'std_error': b1_std_error_m_mm, 'beta': beta
            },
            {
                'term': '(constant)', 'unit': 'm', 'b': b0_m, 'std_error': b0_std_error_m,
                'beta': NULL
            }
        ], recursive := TRUE)
    FROM paper.inverse_model
)
SELECT
    camera, class_name, term, unit, b, std_error, beta, b / nullif(std_error, 0) AS t,
    stats.student_p(t, df) AS sig,
    b - stats.student_95(df) * std_error AS b_low, b + stats.student_95(df) * std_error AS b_high
FROM terms;

COMMENT ON VIEW paper.inverse_model_coefficients IS 'Table 13: what are the coefficients of the inverse model, and are they different from zero? The paper prints 24.910 cm2 (2.491 m mm) and 1.221 cm; Beta is the standardised coefficient, within -1 and 1 (the paper''s -2.965 is none).';
COMMENT ON COLUMN paper.inverse_model_coefficients.term IS '1 / object size (on the sensor, in mm), or the constant.';
COMMENT ON COLUMN paper.inverse_model_coefficients.unit IS 'Unit of b, its standard error and its interval.';
COMMENT ON COLUMN paper.inverse_model_coefficients.b IS 'The coefficient.';
