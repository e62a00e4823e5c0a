"""What a run writes while it runs: rows, ledgers, frames."""
