"""The paper's evaluation over the logs of a whole study: fits, path properties, claims, report."""
