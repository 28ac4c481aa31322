-- Which k does the paper print for each aperture?
-- Table 8; where it gives a range (1.8-2, 2.2-2.5, 4-4.5, 8-9) both ends are entered.
CREATE OR REPLACE VIEW paper.table_8 AS
FROM (VALUES
    (1.8, 0.45), (2.0, 0.45), (2.2, 0.5), (2.5, 0.5), (2.8, 0.66), (3.2, 0.76), (3.5, 0.85),
    (4.0, 0.95), (4.5, 0.95), (5.6, 1.12), (6.3, 1.33), (7.1, 1.43), (8.0, 1.818), (9.0, 1.818),
    (10.0, 2.0), (11.0, 2.2), (13.0, 2.7), (14.0, 2.9), (16.0, 3.2)
) AS printed(f_number, k_printed);

COMMENT ON VIEW paper.table_8 IS 'Which k does the paper print for each aperture? SN Applied Sciences 2021, 3:595, Table 8.';
