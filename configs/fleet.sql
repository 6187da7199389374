-- Ten questions to the table that `syncrelay fleet analyze --into out` writes, for DuckDB: docs/howto/fleet_report.md.

-- The worst recordings, with what was found in them.
SELECT recording, group_name, share, matched_sets, possible_sets, [f.code FOR f IN findings] AS codes
FROM 'out/facts.parquet'
WHERE share IS NOT NULL
ORDER BY share, recording
LIMIT 20;

-- Groups that give less than 80 % of the possible sets, and how often.
SELECT group_name, count(*) FILTER (share < 0.8) AS below, count(share) AS recordings, avg(share) AS mean_share
FROM 'out/facts.parquet'
GROUP BY group_name
HAVING below > 0
ORDER BY below DESC;

-- How each robot changes from day to day.
SELECT robot, day, count(DISTINCT recording) AS recordings, avg(share) AS mean_share
FROM 'out/facts.parquet'
WHERE error IS NULL
GROUP BY robot, day
ORDER BY robot, day;

-- Which finding is the most frequent.
SELECT finding.code, count(DISTINCT recording) AS recordings, sum(finding.seconds) AS seconds
FROM 'out/facts.parquet', unnest(findings) AS each_finding(finding)
GROUP BY finding.code
ORDER BY recordings DESC, finding.code;

-- Which topic is missing, and in how many recordings.
SELECT input.topic, count(DISTINCT recording) FILTER (input.received = 0) AS missing, count(DISTINCT recording) AS recordings
FROM 'out/facts.parquet', unnest(inputs) AS each_input(input)
GROUP BY input.topic
HAVING missing > 0
ORDER BY missing DESC, input.topic;

-- What another slop would give over the whole fleet. Each recording was tried with slops of its own; a candidate
-- counts as the largest that is no wider, so the share is never too high.
SELECT group_name, slop_ms, sum(sets) / nullif(sum(of_messages), 0) AS share
FROM (
  SELECT group_name, recording, slop_ms,
         coalesce(max(trial.sets) FILTER (trial.slop_ms <= candidate.slop_ms), 0) AS sets,
         max(trial.of_messages) AS of_messages
  FROM 'out/facts.parquet', unnest(slop_trials) AS each_trial(trial), (VALUES (2), (5), (10), (20), (50)) AS candidate(slop_ms)
  GROUP BY group_name, recording, slop_ms
)
GROUP BY group_name, slop_ms
ORDER BY group_name, slop_ms;

-- Two releases of a file, compared on the same recordings.
SELECT recording, group_name, old.share AS old_share, new.share AS new_share, new.share - old.share AS change
FROM 'old/facts.parquet' AS old JOIN 'new/facts.parquet' AS new USING (recording, group_name)
WHERE change != 0
ORDER BY change, recording;

-- Recordings that could not be read, or not to their end.
SELECT DISTINCT recording, size_bytes, error, problems
FROM 'out/facts.parquet'
WHERE error IS NOT NULL OR len(problems) > 0
ORDER BY recording;

-- Sensors that were silent for more than 2 s, at the beginning, at the end or in between.
SELECT recording, robot, input.topic, input.first_s, input.last_s, input.longest_gap_ms
FROM 'out/facts.parquet', unnest(inputs) AS each_input(input)
WHERE input.received = 0 OR input.first_s > 2 OR duration_s - input.last_s > 2 OR input.longest_gap_ms > 2000
ORDER BY recording, input.topic;

-- The spread of a topic's rate over the fleet.
SELECT input.topic, min(input.rate_hz) AS least, quantile_cont(input.rate_hz, 0.05) AS low,
       median(input.rate_hz) AS median, quantile_cont(input.rate_hz, 0.95) AS high, max(input.rate_hz) AS greatest
FROM 'out/facts.parquet', unnest(inputs) AS each_input(input)
WHERE input.received > 0
GROUP BY input.topic
ORDER BY input.topic;
