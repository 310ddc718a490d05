"""Campaigns: thousands of runs from one file, on this machine or a Dask cluster, kept whole whatever is killed."""
