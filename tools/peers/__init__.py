"""The job of tools/compare_peers.py in other tools, a file each: counts per detector pixel from the job's numbers.

Every peer takes (rays per screen pixel, seed, job) and returns counts [pixels, pixels]. The job is a dict of numbers,
see job() in compare_peers.py. Lengths are mm.
"""
