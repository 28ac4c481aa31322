-- Metrics, each written once. They aggregate, so a view that groups by something unnests them.

-- Depth: the metrics of the depth-estimation literature (Eigen et al. 2014) and limits of agreement
-- (Bland and Altman 1986). Intervals of 95 % are analytic: normal for the bias, and for the RMSE by
-- the delta method on the mean square. They take the rows as independent; frames of one track are
-- not, so read them as the narrowest that the truth can be (accuracy.by_track counts tracks).
CREATE OR REPLACE MACRO accuracy.depth_metrics(estimate, truth) AS struct_pack(
    n := count(estimate - truth),
    bias_m := avg(estimate - truth),
    bias_low_m := avg(estimate - truth)
        - 1.96 * stddev_samp(estimate - truth) / sqrt(count(estimate - truth)),
    bias_high_m := avg(estimate - truth)
        + 1.96 * stddev_samp(estimate - truth) / sqrt(count(estimate - truth)),
    mae_m := avg(abs(estimate - truth)),
    median_abs_m := median(abs(estimate - truth)),
    p95_abs_m := quantile_cont(abs(estimate - truth), 0.95),
    rmse_m := sqrt(avg((estimate - truth) ** 2)),
    rmse_low_m := sqrt(greatest(0, avg((estimate - truth) ** 2)
        - 1.96 * stddev_samp((estimate - truth) ** 2) / sqrt(count(estimate - truth)))),
    rmse_high_m := sqrt(avg((estimate - truth) ** 2)
        + 1.96 * stddev_samp((estimate - truth) ** 2) / sqrt(count(estimate - truth))),
    abs_rel := avg(abs(estimate - truth) / truth),
    median_abs_rel := median(abs(estimate - truth) / truth),
    sq_rel_m := avg((estimate - truth) ** 2 / truth),
    rmse_log := sqrt(avg((ln(estimate) - ln(truth)) ** 2)),
    si_log := sqrt(greatest(0, avg((ln(estimate) - ln(truth)) ** 2)
        - avg(ln(estimate) - ln(truth)) ** 2)),
    delta_1 := avg((greatest(estimate / truth, truth / estimate) < 1.25)::INTEGER),
    delta_2 := avg((greatest(estimate / truth, truth / estimate) < 1.25 ** 2)::INTEGER),
    delta_3 := avg((greatest(estimate / truth, truth / estimate) < 1.25 ** 3)::INTEGER),
    r := corr(estimate, truth),
    r2 := 1 - sum((estimate - truth) ** 2)
        / nullif(regr_sxx(estimate, truth), 0),
    agreement_low_m := avg(estimate - truth) - 1.96 * stddev_samp(estimate - truth),
    agreement_high_m := avg(estimate - truth) + 1.96 * stddev_samp(estimate - truth)
);

-- Height: bias, mean absolute error, RMSE and mean absolute percentage error.
CREATE OR REPLACE MACRO accuracy.height_metrics(estimate, truth) AS struct_pack(
    height_n := count(estimate - truth),
    height_bias_m := avg(estimate - truth),
    height_mae_m := avg(abs(estimate - truth)),
    height_rmse_m := sqrt(avg((estimate - truth) ** 2)),
    height_mape := avg(abs(estimate - truth) / truth)
);

-- Whether the stated standard deviations are true: the share of errors inside nominal intervals, the
-- mean width of the 95 % interval, and the mean negative log-likelihood of a normal distribution.
CREATE OR REPLACE MACRO accuracy.interval_metrics(error, std) AS struct_pack(
    n := count(error / std),
    coverage_50 := avg((abs(error) <= 0.6745 * std)::INTEGER),
    coverage_80 := avg((abs(error) <= 1.2816 * std)::INTEGER),
    coverage_95 := avg((abs(error) <= 1.9600 * std)::INTEGER),
    mean_width_95_m := avg(2 * 1.96 * std),
    nll := avg(0.5 * ln(2 * pi() * std ** 2) + error ** 2 / (2 * std ** 2))
);
