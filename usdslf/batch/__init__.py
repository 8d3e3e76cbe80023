"""Batch: many shots in one run, on this machine or on a farm, and one asset under many lights.

plan(manifest) -> Plan                      the jobs of a manifest, and which of them are finished
run_batch(plan, engine, hear) -> Summary    runs what is not, each job in a process of its own
run_job(job, say) -> Result                 one job, in this process: for a scheduler of one's own
collect(plan) -> Summary                    what came of all jobs, written as JSON, CSV, HTML and JUnit XML
"""

from usdslf.batch.collect import collect
from usdslf.batch.job import Event, Job, Limits, Result
from usdslf.batch.plan import Plan, plan
from usdslf.batch.run import run_batch
from usdslf.batch.summary import Row, Summary
from usdslf.batch.work import run_job

__all__ = [
    "Event", "Job", "Limits", "Plan", "Result", "Row", "Summary", "collect", "plan", "run_batch", "run_job",
]  # fmt: skip
