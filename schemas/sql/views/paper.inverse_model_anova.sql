-- Table 12: does the object size explain depth?
CREATE OR REPLACE VIEW paper.inverse_model_anova AS
SELECT
    camera, class_name,
    unnest([
        {
            'source': 'Regression', 'sum_of_squares_m2': regression_ss_m2, 'df': 1,
            'mean_square_m2': regression_ss_m2, 'f': f, 'sig': stats.f_p(f, 1, residual_df)
        },
        {
            'source': 'Residual', 'sum_of_squares_m2': residual_ss_m2, 'df': residual_df,
            'mean_square_m2': residual_ms_m2, 'f': NULL, 'sig': NULL
        },
        {
            'source': 'Total', 'sum_of_squares_m2': total_ss_m2, 'df': residual_df + 1,
            'mean_square_m2': NULL, 'f': NULL, 'sig': NULL
        }
    ], recursive := TRUE)
FROM paper.inverse_model;

COMMENT ON VIEW paper.inverse_model_anova IS 'Table 12: does the object size explain depth? Analysis of variance of the inverse model. The paper prints F 3835.039 (its text 2294.695) with 1 and 74 degrees of freedom.';
COMMENT ON COLUMN paper.inverse_model_anova.source IS 'Regression, Residual or Total.';
