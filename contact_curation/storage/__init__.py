"""Everything that is read from and written to disk: recordings, ContactNets' files, stores, manifests, exports."""
